// The program's one entry: parses, runs the command, and turns every error into a message and an
// exit code (0 done, 1 failed, 2 usage, 3 faults or differences found, 130 interrupted).
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <new>
#include <sstream>
#include <string>
#include <string_view>

#include "formats/bytes/errors.h"
#include "formats/bytes/printable.h"
#include "pipeline/common/version.h"
#include "pipeline/run/progress.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/number_options.h"
#include "tools/arguments/printed_streams.h"
#include "tools/commands/build.h"
#include "tools/commands/check.h"
#include "tools/commands/compare.h"
#include "tools/commands/convert.h"
#include "tools/commands/detail.h"
#include "tools/commands/diff.h"
#include "tools/commands/info.h"
#include "tools/commands/serve.h"
#include "tools/commands/synth.h"
#include "tools/commands/tin.h"
#include "tools/commands/verify.h"

namespace {

constexpr int kFailed = 1;
constexpr int kUsage = 2;
constexpr int kInterrupted = 130;

int fail(int code, const std::string& message) {
  std::fflush(stdout);
  std::fputs(("qmpipe: " + qmpipe::printable_message(message) + "\n").c_str(), stderr);
  return code;
}

// Nothing is allocated, for there may be nothing left.
void write_to_terminal(std::string_view text) {
  for (const char c : text) {
    const char shown = c == '\n' || (c >= ' ' && c <= '~') ? c : '?';
    if (::write(STDERR_FILENO, &shown, 1) < 0) return;
  }
}

// Where a library cannot throw any further, as when TBB gets no more threads: the run ends like one
// that was killed, which the same command goes on with, but says why.
[[noreturn]] void end_with_a_message() {
  static std::atomic_flag is_ending = ATOMIC_FLAG_INIT;
  // Another thread is at it, and will end this one.
  while (is_ending.test_and_set()) ::pause();
  write_to_terminal("qmpipe: ");
  try {
    if (const std::exception_ptr error = std::current_exception()) std::rethrow_exception(error);
    write_to_terminal("an error that nobody could handle");
  } catch (const std::exception& error) {
    write_to_terminal(error.what());
  } catch (...) {
    write_to_terminal("an error of a kind that nobody knows");
  }
  write_to_terminal(
      "\n  Where the system gives no more memory or threads: give less to do at a time (--threads "
      "1),"
      "\n  or raise its limits (ulimit -v, ulimit -u).\n");
  std::_Exit(kFailed);
}

int run(int argc, char** argv) {
  CLI::App app{
      "qmpipe turns digital elevation models of any size into quantized-mesh terrain pyramids for "
      "web globes, and single ones into TINs."};
  app.name("qmpipe");
  app.set_version_flag("--version", std::string("qmpipe ") + qmpipe::kProgramVersion);
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  qmpipe build dem.tif -o tiles     the pyramid of a DEM, as a folder for any web server\n"
      "  qmpipe serve tiles                look at it: http://127.0.0.1:8080/\n"
      "  qmpipe verify tiles --source dem.tif\n"
      "`qmpipe COMMAND --help` has a command's options, their units and defaults, and more "
      "examples.");
  qmpipe::set_help_format(app);
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
  qmpipe::read_decimal_numbers_only(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 counts help and version as "errors" with exit code 0. What it prints itself would not
    // pass our streams.
    std::ostringstream out;
    std::ostringstream complaint;
    const int code = app.exit(error, out, complaint);
    std::fputs(out.str().c_str(), stdout);
    std::fputs(qmpipe::printable_message(complaint.str()).c_str(), stderr);
    if (code != 0) return kUsage;
    qmpipe::require_printed();
    return 0;
  }
  const int code = action();
  qmpipe::require_printed();
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  const qmpipe::PrintedStreams printed;
  std::set_terminate(end_with_a_message);
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
