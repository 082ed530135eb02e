// Units of height as raster files spell them.
#pragma once

#include <optional>
#include <string_view>

namespace qmpipe {

// Metres in one unit: "m", "ft" (international), "us-ft" (US survey), "cm", "km", "fathom" ... in
// any case and with or without plural. None for a name we do not know. An empty name means metres.
std::optional<double> metres_per_unit(std::string_view name);

}  // namespace qmpipe
