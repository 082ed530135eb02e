// The program's one entry: parses, runs the command, and turns every error into a message and an
// exit code (0 done, 1 failed, 2 usage, 3 faults or differences found, 130 interrupted).
#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <new>
#include <sstream>
#include <string>

#include "formats/errors.h"
#include "formats/printable.h"
#include "pipeline/progress.h"
#include "pipeline/version.h"
#include "tools/command_build.h"
#include "tools/command_check.h"
#include "tools/command_compare.h"
#include "tools/command_convert.h"
#include "tools/command_detail.h"
#include "tools/command_diff.h"
#include "tools/command_info.h"
#include "tools/command_serve.h"
#include "tools/command_synth.h"
#include "tools/command_tin.h"
#include "tools/command_verify.h"
#include "tools/printed_streams.h"

namespace {

constexpr int kFailed = 1;
constexpr int kUsage = 2;
constexpr int kInterrupted = 130;

int fail(int code, const std::string& message) {
  std::fflush(stdout);
  std::fputs(("qmpipe: " + qmpipe::printable_message(message) + "\n").c_str(), stderr);
  return code;
}

int run(int argc, char** argv) {
  CLI::App app{
      "qmpipe turns digital elevation models of any size into quantized-mesh terrain pyramids for "
      "web globes, and single ones into TINs."};
  app.name("qmpipe");
  app.set_version_flag("--version", std::string("qmpipe ") + qmpipe::kProgramVersion);
  app.require_subcommand(1);
  app.footer("Try `qmpipe <command> --help` for a command's options, units and an example.");
  std::function<int()> action;
  qmpipe::register_build(app, action);
  qmpipe::register_verify(app, action);
  qmpipe::register_serve(app, action);
  qmpipe::register_check(app, action);
  qmpipe::register_compare(app, action);
  qmpipe::register_convert(app, action);
  qmpipe::register_diff(app, action);
  qmpipe::register_info(app, action);
  qmpipe::register_detail(app, action);
  qmpipe::register_tin(app, action);
  qmpipe::register_synth(app, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 counts help and version as "errors" with exit code 0. What it prints itself would not
    // pass our streams.
    std::ostringstream out;
    std::ostringstream complaint;
    const int code = app.exit(error, out, complaint);
    std::fputs(out.str().c_str(), stdout);
    std::fputs(complaint.str().c_str(), stderr);
    return code == 0 ? 0 : kUsage;
  }
  return action();
}

}  // namespace

int main(int argc, char** argv) {
  const qmpipe::PrintedStreams printed;
  try {
    return run(argc, argv);
  } catch (const qmpipe::UsageError& error) {
    return fail(kUsage, error.what());
  } catch (const qmpipe::Interrupted& error) {
    return fail(kInterrupted, error.what());
  } catch (const std::bad_alloc&) {
    return fail(kFailed, "out of memory; give less to do at a time or a smaller --memory");
  } catch (const std::exception& error) {
    return fail(kFailed, error.what());
  }
}
