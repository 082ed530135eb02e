#include "tools/commands/check.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "pipeline/web_check/check_url.h"
#include "tools/arguments/exit_codes.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/web/http_client.h"

namespace qmpipe {
namespace {

constexpr int kExitUnanswered = 1;

constexpr const char* kCheckFooter =
    "Asks for layer.json and for a sample of tiles as CesiumJS on a page of another site would,\n"
    "and says in plain words what is wrong, what a viewer shows because of it, and what to do:\n"
    "no CORS header; gzip that is not announced; web pages instead of tiles; a layer.json that\n"
    "viewers refuse or misread; tiles that are missing, cut off, damaged or upside down; and "
    "more.\n"
    "The sample: the root tiles, the middle and the corners of each zoom, and some at random, the\n"
    "same each time. Sets with metadataAvailability are walked down from the roots.\n"
    "\n"
    "Faults keep viewers from showing the set or parts of it; warnings trouble some viewers or\n"
    "pages; hints cost something only. A set that is served without CORS header works in pages of\n"
    "the same host: a warning, unless --origin names a page of another one.\n"
    "`qmpipe verify` reads all tiles of a folder, and looks deeper.\n"
    "\n"
    "Exit code 0: no fault; 1: nobody answers; 2: usage; 3: faults found; 130: interrupted.\n"
    "Proxies are taken from the environment (http_proxy, https_proxy, no_proxy).\n"
    "\n"
    "Examples:\n"
    "  qmpipe check https://example.org/terrain/\n"
    "  qmpipe check http://localhost:8080/layer.json --origin http://localhost:5173 --json";

struct CheckArguments {
  std::string address;
  web_check::CheckOptions options;
  double timeout_s = 10;
  bool wants_json = false;
};

int run_check(const CheckArguments& arguments) {
  web::HttpClient client(arguments.timeout_s, stop_flag_of_signals());
  const web_check::CheckReport report =
      check_url(arguments.address, arguments.options,
                [&client](const web_check::HttpQuestion& request) { return client.send(request); });
  const std::string text = arguments.wants_json ? json_of(report) : text_of(report);
  std::fwrite(text.data(), 1, text.size(), stdout);
  if (!report.is_answered) return kExitUnanswered;
  return report.count(web_check::CheckSeverity::kFault) == 0 ? 0 : kExitFaults;
}

}  // namespace

void register_check(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<CheckArguments>();
  CLI::App* command = app.add_subcommand(
      "check", "Look at a tile set on a web server as viewers would, and say what is wrong");
  command->footer(kCheckFooter);
  begin_group(*command, kInputGroup);
  command
      ->add_option("URL", arguments->address,
                   "Address of the tile set's folder, or of the layer.json in it")
      ->required();
  begin_group(*command, kResourcesGroup);
  command->add_option("--tiles", arguments->options.most_tiles, "Tiles to ask for at most")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command
      ->add_option("--timeout", arguments->timeout_s, "Seconds that one answer may take as a whole")
      ->type_name("SECONDS")
      ->check(CLI::Range(0.01, 3600.0))
      ->capture_default_str();
  begin_group(*command, kInputGroup);
  command
      ->add_option("--origin", arguments->options.origin,
                   "Origin of the page that shows the tiles; what it may not load is a fault "
                   "(default: some other site, and then it is a warning)")
      ->type_name("ORIGIN");
  begin_group(*command, kMessagesGroup);
  command->add_flag("--json", arguments->wants_json, "Write one JSON object instead of text");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_check(*arguments); }; });
}

}  // namespace qmpipe
