// A comparison as one self-contained HTML page: tables, charts, pictures (Campos et al. 2020, Tables 2,
// 4 and 5, Figures 7 and 8).
#pragma once

#include <string>

#include "pipeline/compare/compare.h"

namespace qmpipe {

std::string comparison_page(const Comparison& comparison);

}  // namespace qmpipe
