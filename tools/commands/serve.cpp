#include "tools/commands/serve.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/printable.h"
#include "formats/tile_sets/open_tile_set.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/arguments/printed_streams.h"
#include "tools/commands/detail_commands.h"
#include "tools/web/detail_service.h"
#include "tools/web/http_server.h"
#include "tools/web/page_files.h"
#include "tools/web/tile_service.h"

namespace qmpipe {
namespace {

constexpr const char* kServeFooter =
    "A tile set opens with a page that shows the terrain in CesiumJS, lit and coloured by\n"
    "height. In a page of your own:\n"
    "  Cesium.CesiumTerrainProvider.fromUrl(\"http://127.0.0.1:8080/tiles\")\n"
    "Tiles are sent with their media type and, where they are gzipped, with Content-Encoding; any\n"
    "page may load them (CORS). A layer.json that is missing or does not fit the tiles is put\n"
    "right on the way out; the files stay as they are.\n"
    "A detail-increment model (qmpipe detail build) opens with a page that makes it finer as the\n"
    "eye comes closer, in three.js.\n"
    "Other machines are served only with --host 0.0.0.0: this server knows no passwords and no\n"
    "https.\n"
    "Ctrl-C ends it.\n"
    "\n"
    "Examples:\n"
    "  qmpipe serve tiles\n"
    "  qmpipe serve terrain.mbtiles --port 9000\n"
    "  qmpipe serve terrain.h5";

struct ServeArguments {
  std::string path;
  web::ListenOptions listen;
  bool wants_json = false;
};

std::string address_of(const ServeArguments& arguments, int port) {
  const std::string& host = arguments.listen.host;
  const bool is_any = host == "0.0.0.0" || host == "::";
  const bool is_ipv6 = host.find(':') != std::string::npos && !is_any;
  return fmt::format("http://{}:{}/", is_any ? "localhost" : (is_ipv6 ? "[" + host + "]" : host),
                     port);
}

std::string greeting(const ServeArguments& arguments, const web::TileService& service,
                     const web::PageFiles& pages, int port) {
  const std::string address = address_of(arguments, port);
  if (arguments.wants_json) {
    const nlohmann::ordered_json object = {{"viewer", address},
                                           {"terrain", address + "tiles"},
                                           {"port", port},
                                           {"tiles", service.tiles()},
                                           {"layer_changes", service.layer_changes()}};
    return object.dump() + "\n";
  }
  std::string text = fmt::format("{}: {} tiles, down to zoom {}\n", printable_line(arguments.path),
                                 service.tiles(), service.deepest_zoom());
  for (const std::string& change : service.layer_changes()) {
    text += fmt::format("  layer.json does not fit the tiles; as it is served, {}\n",
                        printable_line(change));
  }
  text += fmt::format("  to look at it   {}\n  terrain         {}tiles\n", address, address);
  if (!pages.has_cesium()) {
    text += "  CesiumJS is not installed, so the page stays empty: run tools/setup.sh\n";
  }
  return text + "Ctrl-C ends it.\n";
}

std::string greeting(const ServeArguments& arguments, const web::DetailService& service,
                     const web::PageFiles& pages, int port) {
  const std::string address = address_of(arguments, port);
  if (arguments.wants_json) {
    const nlohmann::ordered_json object = {{"viewer", address},
                                           {"model", address + "model.json"},
                                           {"port", port},
                                           {"blocks", service.blocks()},
                                           {"coarsest_triangles", service.coarsest_triangles()},
                                           {"finest_triangles", service.finest_triangles()}};
    return object.dump() + "\n";
  }
  std::string text = fmt::format("{}: {} to {} triangles in {} blocks\n  to look at it   {}\n",
                                 printable_line(arguments.path), service.coarsest_triangles(),
                                 service.finest_triangles(), service.blocks(), address);
  if (!pages.has_three()) {
    text += "  three.js is not installed, so the page stays empty: run tools/setup.sh\n";
  }
  return text + "Ctrl-C ends it.\n";
}

// `start_page`: the address of the file that "/" is answered with.
template <class Service>
int serve(const ServeArguments& arguments, const Service& service, const char* start_page) {
  const web::PageFiles pages(web::find_page_folder());
  // From before anybody can know of the server.
  const std::atomic<bool>& stop = *stop_flag_of_signals();
  web::HttpServer server(arguments.listen, [&](web::HttpRequest request) {
    if (request.path == "/") request.path = start_page;
    std::optional<web::HttpReply> reply = service.answer(request);
    return reply ? reply : pages.answer(request);
  });
  const std::string text = greeting(arguments, service, pages, server.port());
  std::fputs(text.c_str(), stdout);
  require_printed();
  server.run(stop);
  return 0;
}

// Of HDF5, which no form of a tile set is.
bool looks_like_a_model(const std::string& path) {
  constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1A, '\n'};
  const auto start = read_file_range(path, 0, kSignature.size());
  return start && std::equal(start->begin(), start->end(), kSignature.begin());
}

int run_serve(const ServeArguments& arguments) {
  const std::string name = std::filesystem::absolute(arguments.path).lexically_normal().stem();
  if (looks_like_a_model(arguments.path)) {
    return serve(arguments, web::DetailService(load_model(arguments.path), name), "/detail.html");
  }
  std::unique_ptr<TileSet> tile_set = open_tile_set(arguments.path);
  if (tile_set->keys().empty()) {
    throw IoError("cannot serve", arguments.path, "there is no tile in it", "Check the path.");
  }
  return serve(arguments, web::TileService(std::move(tile_set), name), "/index.html");
}

}  // namespace

void register_serve(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<ServeArguments>();
  CLI::App* command = app.add_subcommand(
      "serve", "Serve a tile set or a detail-increment model over HTTP, with a page that shows it");
  command->footer(kServeFooter);
  command
      ->add_option("OUT", arguments->path,
                   "The tile set: its folder, an .mbtiles or a .pmtiles file, ours or another "
                   "program's; or the file of a detail-increment model")
      ->required();
  begin_group(*command, kOutputGroup);
  command->add_option("--port", arguments->listen.port, "Port; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->add_option("--host", arguments->listen.host, "Address to listen on")
      ->type_name("ADDRESS")
      ->capture_default_str();
  begin_group(*command, kResourcesGroup);
  command
      ->add_option("--threads", arguments->listen.threads,
                   "Connections served at a time; others wait")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  begin_group(*command, kMessagesGroup);
  command->add_flag("--json", arguments->wants_json,
                    "Say where it listens as a JSON object, on one line");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_serve(*arguments); }; });
}

}  // namespace qmpipe
