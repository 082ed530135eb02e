#include "tools/command_serve.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "formats/errors.h"
#include "formats/tile_set.h"
#include "tools/http_server.h"
#include "tools/interrupt.h"
#include "tools/page_files.h"
#include "tools/tile_service.h"

namespace qmpipe {
namespace {

constexpr const char* kFooter =
    "Opens with a page that shows the terrain in CesiumJS, lit and coloured by height. In a page "
    "of\n"
    "your own: Cesium.CesiumTerrainProvider.fromUrl(\"http://127.0.0.1:8080/tiles\").\n"
    "Tiles are sent with their media type and, where they are gzipped, with Content-Encoding; any\n"
    "page may load them (CORS). A layer.json that is missing or does not fit the tiles is put "
    "right\n"
    "on the way out; the files stay as they are. Other machines are served only with --host "
    "0.0.0.0:\n"
    "this server knows no passwords and no https.\n"
    "Ctrl-C ends it.\n"
    "\n"
    "Examples:\n"
    "  qmpipe serve tiles\n"
    "  qmpipe serve terrain.mbtiles --port 9000";

struct ServeArguments {
  std::string path;
  ListenOptions listen;
  bool wants_json = false;
};

std::string address_of(const ServeArguments& arguments, int port) {
  const std::string& host = arguments.listen.host;
  const bool is_any = host == "0.0.0.0" || host == "::";
  const bool is_ipv6 = host.find(':') != std::string::npos && !is_any;
  return fmt::format("http://{}:{}/", is_any ? "localhost" : (is_ipv6 ? "[" + host + "]" : host),
                     port);
}

std::string greeting(const ServeArguments& arguments, const TileService& service,
                     const PageFiles& pages, int port) {
  const std::string address = address_of(arguments, port);
  if (arguments.wants_json) {
    const nlohmann::ordered_json object = {{"viewer", address},
                                           {"terrain", address + "tiles"},
                                           {"port", port},
                                           {"tiles", service.tiles()},
                                           {"layer_changes", service.layer_changes()}};
    return object.dump() + "\n";
  }
  std::string text = fmt::format("{}: {} tiles, down to zoom {}\n", arguments.path, service.tiles(),
                                 service.deepest_zoom());
  for (const std::string& change : service.layer_changes()) {
    text += fmt::format("  layer.json does not fit the tiles; as it is served, {}\n", change);
  }
  text += fmt::format("  to look at it   {}\n  terrain         {}tiles\n", address, address);
  if (!pages.has_cesium()) {
    text += "  CesiumJS is not installed, so the page stays empty: run tools/setup.sh\n";
  }
  return text + "Ctrl-C ends it.\n";
}

int run_serve(const ServeArguments& arguments) {
  std::unique_ptr<TileSet> tile_set = open_tile_set(arguments.path);
  if (tile_set->keys().empty()) {
    throw IoError("cannot serve", arguments.path, "there is no tile in it", "Check the path.");
  }
  const std::string name = std::filesystem::absolute(arguments.path).lexically_normal().stem();
  const TileService service(std::move(tile_set), name);
  const PageFiles pages(find_page_folder());
  HttpServer server(arguments.listen, [&](const HttpRequest& request) {
    std::optional<HttpReply> reply = service.answer(request);
    return reply ? reply : pages.answer(request);
  });
  const std::string text = greeting(arguments, service, pages, server.port());
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
  server.run(*stop_flag_of_signals());
  return 0;
}

}  // namespace

void register_serve(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<ServeArguments>();
  CLI::App* command =
      app.add_subcommand("serve", "Serve a tile set over HTTP, with a page that shows it");
  command->footer(kFooter);
  command
      ->add_option("OUT", arguments->path,
                   "The tile set: its folder, an .mbtiles or a .pmtiles file, ours or another "
                   "program's")
      ->required();
  command->add_option("--port", arguments->listen.port, "Port; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->add_option("--host", arguments->listen.host, "Address to listen on")
      ->type_name("ADDRESS")
      ->capture_default_str();
  command
      ->add_option("--threads", arguments->listen.threads,
                   "Connections served at a time; others wait")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  command->add_flag("--json", arguments->wants_json,
                    "Say where it listens as a JSON object, on one line");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_serve(*arguments); }; });
}

}  // namespace qmpipe
