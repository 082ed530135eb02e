#include "tools/web/page_files.h"

#include <array>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/folders.h"
#include "formats/bytes/hash64.h"

namespace qmpipe::web {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestPageBytes = std::size_t{64} << 20U;

std::string media_type_of(const fs::path& path) {
  constexpr std::array<std::pair<std::string_view, const char*>, 17> kTypes = {{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".txt", "text/plain; charset=utf-8"},
      {".md", "text/plain; charset=utf-8"},
      {".xml", "application/xml"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".gif", "image/gif"},
      {".ico", "image/x-icon"},
      {".webp", "image/webp"},
      {".ktx2", "image/ktx2"},
      {".wasm", "application/wasm"},
      {".woff2", "font/woff2"},
  }};
  const std::string extension = path.extension().string();
  for (const auto& [suffix, type] : kTypes) {
    if (extension == suffix) return type;
  }
  return "application/octet-stream";
}

bool is_file(const fs::path& path) {
  std::error_code code;
  return fs::is_regular_file(path, code);
}

}  // namespace

PageFiles::PageFiles(const fs::path& folder) {
  for (const fs::directory_entry& entry : entries_of(folder)) {
    const std::string extension = entry.path().extension().string();
    if (!is_file(entry.path()) || (extension != ".html" && extension != ".js")) continue;
    files_["/" + entry.path().filename().string()] = entry.path();
  }
  const auto index = files_.find("/index.html");
  if (index == files_.end()) {
    throw IoError("cannot serve the pages in", folder.string(), "there is no index.html in it",
                  "Set QMPIPE_VIEWER to the folder tools/viewer of qmpipe's source.");
  }
  files_["/"] = index->second;
  for (const fs::path& cesium :
       {folder / "cesium", folder / "node_modules" / "cesium" / "Build" / "Cesium"}) {
    if (has_cesium() || !is_file(cesium / "Cesium.js")) continue;
    list(cesium, "/cesium/");
  }
  add_three(folder);
}

void PageFiles::add_three(const fs::path& folder) {
  const fs::path npm = folder / "node_modules" / "three";
  const std::array<std::pair<const char*, fs::path>, 3> in_npm = {{
      {"three.module.js", npm / "build"},
      {"three.core.js", npm / "build"},
      {"OrbitControls.js", npm / "examples" / "jsm" / "controls"},
  }};
  for (const auto& [name, installed_by_npm] : in_npm) {
    for (const fs::path& place : {installed_by_npm, folder / "three"}) {
      if (is_file(place / name)) files_[std::string("/three/") + name] = place / name;
    }
  }
}

void PageFiles::list(const fs::path& folder, const std::string& address) {
  for (const fs::directory_entry& entry : entries_of(folder)) {
    const std::string name = entry.path().filename().string();
    // Links could lead anywhere, and in circles.
    std::error_code code;
    const fs::file_type type = entry.symlink_status(code).type();
    if (type == fs::file_type::directory) list(entry.path(), address + name + "/");
    if (type == fs::file_type::regular) files_[address + name] = entry.path();
  }
}

std::optional<HttpReply> PageFiles::answer(const HttpRequest& request) const {
  const auto file = files_.find(request.path);
  if (file == files_.end()) return std::nullopt;
  const auto bytes = read_file_bytes(file->second, kLargestPageBytes);
  if (!bytes) return error_reply(500, bytes.error().message);
  HttpReply reply =
      cached_reply(request, media_type_of(file->second), std::string(bytes->begin(), bytes->end()),
                   std::to_string(hash64(*bytes, 0)));
  reply.headers.emplace_back("Cache-Control", "no-cache");
  return reply;
}

fs::path find_page_folder() {
  if (const char* named = std::getenv("QMPIPE_VIEWER")) return named;
  std::error_code code;
  const fs::path program = fs::read_symlink("/proc/self/exe", code);
  const fs::path installed = program.parent_path().parent_path() / "share" / "qmpipe" / "viewer";
  for (const fs::path& folder : {installed, fs::path(QMPIPE_VIEWER_SOURCE)}) {
    if (is_file(folder / "index.html")) return folder;
  }
  throw IoError("cannot find the viewer in", installed.string(), "it is not there",
                "Set QMPIPE_VIEWER to the folder tools/viewer of qmpipe's source.");
}

}  // namespace qmpipe::web
