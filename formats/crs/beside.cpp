#include "formats/crs/beside.h"

#include <cpl_vsi.h>
#include <sys/stat.h>

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/bytes/free_with.h"
#include "formats/crs/paths.h"

namespace qmpipe {
namespace {

// Statistics and attribute tables make the longest of them.
constexpr vsi_l_offset kLongestSidecar = 4 << 20;
constexpr vsi_l_offset kPart = 64 << 10;

using VsiFile = std::unique_ptr<VSILFILE, FreeWith<VSIFCloseL>>;

bool is_looked_at(const std::string& path) {
  return !path.starts_with("/vsi") || path.starts_with("/vsizip/");
}

std::string read_part(VSILFILE* file, vsi_l_offset from, vsi_l_offset bytes) {
  std::string part(bytes, '\0');
  if (VSIFSeekL(file, from, SEEK_SET) != 0) return {};
  part.resize(VSIFReadL(part.data(), 1, part.size(), file));
  return part;
}

std::optional<std::string> path_in(const std::string& part) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  std::string_view text = part;
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  const bool is_xml = first != std::string_view::npos && text[first] == '<';
  return is_xml ? path_in_crs_of_xml(text) : path_in_crs(text);
}

void require_no_path_in(const std::string& path, vsi_l_offset bytes, vsi_l_offset whole_up_to) {
  const VsiFile file(VSIFOpenL(path.c_str(), "rb"));
  if (!file) return;
  const auto look = [&](vsi_l_offset from, vsi_l_offset length) {
    if (const auto named = path_in(read_part(file.get(), from, length))) {
      refuse_path_in_crs(path, *named);
    }
  };
  if (bytes <= whole_up_to) {
    look(0, bytes);
    return;
  }
  look(0, kPart);
  // To its end an archive's member would have to be unpacked.
  if (!path.starts_with("/vsi")) look(bytes - kPart, kPart);
}

struct Sidecar {
  std::string path;
  bool is_text = false;
};

std::vector<Sidecar> sidecars_of(const std::string& raster) {
  static constexpr std::array<const char*, 9> kTexts = {".prj", ".PRJ", ".Prj", ".aux.xml", ".aux",
                                                        ".hdr", ".HDR", ".xml", ".XML"};
  static constexpr std::array<const char*, 5> kOthers = {".ovr", ".msk", ".rrd", ".tfw", ".wld"};
  const std::filesystem::path path(raster);
  const std::string stem = (path.parent_path() / path.stem()).string();
  std::vector<Sidecar> sidecars;
  for (const std::string& start : {stem, raster}) {
    for (const char* const ending : kTexts) sidecars.push_back({start + ending, true});
    for (const char* const ending : kOthers) sidecars.push_back({start + ending, false});
  }
  return sidecars;
}

}  // namespace

void require_no_path_in_crs(const std::string& raster) {
  if (!is_looked_at(raster)) return;
  VSIStatBufL status;
  const auto bytes = [&status] { return static_cast<vsi_l_offset>(status.st_size); };
  if (VSIStatL(raster.c_str(), &status) == 0 && S_ISREG(status.st_mode)) {
    require_no_path_in(raster, bytes(), 2 * kPart);
  }
  for (const auto& [path, is_text] : sidecars_of(raster)) {
    if (path == raster || VSIStatL(path.c_str(), &status) != 0) continue;
    if (S_ISREG(status.st_mode)) {
      require_no_path_in(path, bytes(), is_text ? kLongestSidecar : 2 * kPart);
    } else if (!S_ISDIR(status.st_mode)) {
      throw IoError("cannot open the raster", raster,
                    "GDAL would read " + path + " with it, which is a pipe or a device",
                    "remove that");
    }
  }
}

void refuse_path_in_crs(const std::string& file, const std::string& named) {
  throw IoError("cannot use the CRS in", file,
                "it names a file of this machine, '" + named +
                    "', and files that came with data open no others",
                "where that grid is wanted, copy it to a folder that PROJ_LIB names and write its "
                "bare name into the CRS; else take this CRS out and say which one it is with "
                "--source-crs EPSG:n");
}

}  // namespace qmpipe
