// The viewer's pages and the libraries they need, as files of a web server.
//
// The files are listed once, when the server starts, and only what is on that list is ever opened:
// no address can lead out of the folder.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "tools/web/tile_service.h"

namespace qmpipe::web {

class PageFiles {
 public:
  // `folder` holds index.html; CesiumJS is its subfolder cesium and three.js its subfolder three, or
  // what npm installed there. Of three.js the files that detail.html loads are served, under /three/.
  // Throws IoError when the folder has no index.html or cannot be listed.
  explicit PageFiles(const std::filesystem::path& folder);

  // Nothing when no file has that address.
  std::optional<HttpReply> answer(const HttpRequest& request) const;

  bool has_cesium() const { return files_.contains("/cesium/Cesium.js"); }
  bool has_three() const { return files_.contains("/three/three.module.js"); }

 private:
  void add_three(const std::filesystem::path& folder);
  void list(const std::filesystem::path& folder, const std::string& address);

  std::map<std::string, std::filesystem::path, std::less<>> files_;  // by address
};

// Where the pages are: $QMPIPE_VIEWER, share/qmpipe/viewer of the installation that the program
// belongs to, or its source. Throws IoError when none of them is there.
std::filesystem::path find_page_folder();

}  // namespace qmpipe::web
