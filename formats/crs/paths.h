// The files that the text of a CRS names. PROJ opens grids of a datum shift, tables of definitions and
// meshes by their paths, some of them while it parses; bare names it seeks in its own folders.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace qmpipe {

// The first path (with a separator, or from a home folder) that a CRS in `text` names: in WKT 1 or 2
// or PROJJSON anywhere in it, and in a PROJ string where that is all of the text. Bytes that are no
// CRS name none. Throws nothing.
std::optional<std::string> path_in_crs(std::string_view text);

// The same of the texts within an XML document: its elements, attributes and CDATA sections.
std::optional<std::string> path_in_crs_of_xml(std::string_view xml);

}  // namespace qmpipe
