#include "pipeline/run/progress.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <random>

#include "formats/bytes/printable.h"
#include "tests/support/terminal_model.h"

namespace qmpipe::progress_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::TerminalModel;

std::int64_t up_to(std::mt19937& random, std::int64_t most) {
  return std::uniform_int_distribution<std::int64_t>(0, most)(random);
}

PhaseState state_of(std::mt19937& random) {
  static const std::string names[] = {"mesh",
                                      "survey",
                                      "verify",
                                      "survey of zoom 12",
                                      "\u9ad8\u3055\u306e\u8abf\u67fb",
                                      "\U0001f5fb relief"};
  PhaseState state = {.phase = names[random() % std::size(names)],
                      .unit = random() % 2 == 0 ? "tiles" : "posts"};
  state.total = up_to(random, random() % 2 == 0 ? 5000 : 1'000'000'000'000'000);
  state.done = up_to(random, state.total);
  state.rate_per_s = static_cast<double>(up_to(random, 100'000'000));
  if (random() % 3 != 0) state.left_s = static_cast<double>(up_to(random, 400'000));
  if (random() % 5 == 0) state.took_s = static_cast<double>(up_to(random, 400'000));
  for (auto n = random() % 7; n > 0; --n) {
    state.fills.push_back({"stage", up_to(random, 1000), up_to(random, 1000)});
  }
  return state;
}

TEST(ProgressLine, FitsEveryWidth) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    std::mt19937 random(seed);
    const PhaseState state = state_of(random);
    for (std::int64_t columns = 0; columns <= 300; ++columns) {
      ASSERT_LE(columns_of(progress_line(state, columns)), columns) << "seed " << seed;
    }
  }
}

TEST(ProgressLine, GivesUpWhatMattersLeastFirst) {
  const PhaseState state = {.phase = "mesh",
                            .unit = "tiles",
                            .done = 1300000,
                            .done_before = 0,
                            .total = 12345678,
                            .rate_per_s = 4321,
                            .left_s = 3723,
                            .took_s = std::nullopt,
                            .fills = {{"ready", 3, 0}, {"window", 1, 80}}};
  EXPECT_EQ(
      progress_line(state, 300),
      "mesh: 1,300,000/12,345,678 tiles (10 %), 4,321/s, 1 h 02 min left | ready 3 | window 1/80");
  EXPECT_EQ(progress_line(state, 80),
            "mesh: 1,300,000/12,345,678 tiles (10 %), 4,321/s, 1 h 02 min left | ready 3");
  EXPECT_EQ(progress_line(state, 60), "mesh: 1,300,000/12,345,678 tiles (10 %), 1 h 02 min left");
  EXPECT_EQ(progress_line(state, 40), "mesh: 10 %, 1 h 02 min left");
  EXPECT_EQ(progress_line(state, 20), "mesh 10 %");
  EXPECT_EQ(progress_line(state, 5), "10 %");
  EXPECT_EQ(progress_line(state, 2), "10");
}

TEST(ProgressLine, SaysAllOnlyOfAll) {
  EXPECT_THAT(progress_line(
                  {.phase = "p", .unit = "u", .done = 9999, .done_before = 0, .total = 10000}, 80),
              HasSubstr("(99 %)"));
  EXPECT_THAT(progress_line(
                  {.phase = "p", .unit = "u", .done = 10000, .done_before = 0, .total = 10000}, 80),
              HasSubstr("(100 %)"));
}

// Lines replace each other while the window is made narrower and wider and ^C is typed.
TEST(ProgressLine, LeavesNothingBehindWhateverTheWindowDoes) {
  for (unsigned seed = 0; seed < 2000; ++seed) {
    std::mt19937 random(seed);
    std::int64_t window = 20 + up_to(random, 280);
    TerminalModel terminal(window);
    terminal.feed("before\r\n");
    std::int64_t shown = 0;
    for (int update = 0; update < 6; ++update) {
      const std::string line = progress_line(state_of(random), window - 3);
      terminal.feed(erasing_text(shown, window) + line);
      shown = columns_of(line);
      if (random() % 4 == 0) {
        terminal.feed("^C");
      } else if (random() % 2 == 0) {
        window = 20 + up_to(random, 280);
        terminal.resize(window);
      }
    }
    terminal.feed(erasing_text(shown, window) + "after\r\n");
    ASSERT_THAT(terminal.rows(), ElementsAre("before", "after")) << "seed " << seed;
  }
}

// stderr as a terminal of its own.
class OwnTerminal {
 public:
  explicit OwnTerminal(int columns) : stderr_(::dup(STDERR_FILENO)) {
    master_ = ::posix_openpt(O_RDWR | O_NOCTTY);
    ::grantpt(master_);
    ::unlockpt(master_);
    const int slave = ::open(::ptsname(master_), O_RDWR | O_NOCTTY);
    resize(columns);
    ::dup2(slave, STDERR_FILENO);
    ::close(slave);
    ::fcntl(master_, F_SETFL, O_NONBLOCK);
  }
  ~OwnTerminal() {
    ::dup2(stderr_, STDERR_FILENO);
    ::close(stderr_);
    ::close(master_);
  }
  OwnTerminal(const OwnTerminal&) = delete;
  OwnTerminal& operator=(const OwnTerminal&) = delete;

  void resize(int columns) const {
    winsize size{};
    size.ws_col = static_cast<unsigned short>(columns);
    size.ws_row = 24;
    ASSERT_EQ(::ioctl(master_, TIOCSWINSZ, &size), 0);
  }
  // What was written since the last call.
  std::string read() const {
    std::string text;
    char buffer[4096];
    for (ssize_t n = 0; (n = ::read(master_, buffer, sizeof buffer)) > 0;) {
      text.append(buffer, static_cast<std::size_t>(n));
    }
    return text;
  }
  // Until that many lines of progress came.
  std::string read_updates(int count) const {
    std::string text;
    for (int tries = 0; tries < 10000; ++tries) {
      text += read();
      std::int64_t updates = 0;
      for (std::size_t at = 0; (at = text.find("\r\033[", at)) != std::string::npos; ++at)
        ++updates;
      if (updates >= count) return text;
      ::usleep(500);
    }
    ADD_FAILURE() << "no progress in " << text;
    return text;
  }

 private:
  int stderr_;
  int master_ = -1;
};

ProgressOptions quick(ProgressStyle style) {
  return {.style = style, .interval = std::chrono::milliseconds(1)};
}

void two_phases(Progress& progress, const OwnTerminal& terminal, std::string& seen) {
  for (const char* name : {"survey", "mesh"}) {
    const Phase phase(progress, {.name = name, .unit = "tiles", .total = 123'456'789, .fills = [] {
                                   return std::vector<BufferFill>(6, {"some buffer", 12, 80});
                                 }});
    progress.advance(23'456'789);
    seen += terminal.read_updates(3);
    progress.note("a note");
    progress.advance(100'000'000);
    seen += terminal.read_updates(2);
  }
  seen += terminal.read();
}

TEST(ProgressInATerminal, KeepsOneRowForEachPhaseAndNoteAtEveryWidth) {
  for (int columns = 20; columns <= 300; ++columns) {
    std::string seen;
    {
      const OwnTerminal own(columns);
      ProgressOptions options = quick(ProgressStyle::kTerminal);
      options.shows_buffers = columns % 2 == 0;
      Progress progress(options);
      two_phases(progress, own, seen);
    }
    TerminalModel terminal(columns);
    terminal.feed(seen);
    const std::vector<std::string> rows = terminal.rows();
    ASSERT_EQ(rows.size(), 4U) << columns << " columns: " << seen;
    ASSERT_EQ(rows[0], "qmpipe: a note");
    ASSERT_TRUE(rows[1].starts_with("survey")) << rows[1];
    ASSERT_EQ(rows[2], "qmpipe: a note");
    ASSERT_TRUE(rows[3].starts_with("mesh")) << rows[3];
    ASSERT_EQ(seen.find("some buffer") != std::string::npos, columns % 2 == 0 && columns > 90)
        << columns << " columns";
  }
}

TEST(ProgressInATerminal, FollowsTheWindow) {
  const OwnTerminal own(120);
  Progress progress(quick(ProgressStyle::kTerminal));
  const Phase phase(progress, "mesh", "tiles", 1'000'000);
  progress.advance(500'000);
  EXPECT_THAT(own.read_updates(2), HasSubstr("500,000/1,000,000 tiles (50 %)"));
  own.resize(30);
  own.read_updates(2);
  EXPECT_THAT(own.read_updates(2), Not(HasSubstr("500,000")));
  own.resize(200);
  own.read_updates(2);
  EXPECT_THAT(own.read_updates(2), HasSubstr("500,000/1,000,000 tiles (50 %)"));
}

// Serial lines and some containers have terminals that do not know their width.
TEST(ProgressInATerminal, AsksTheEnvironmentWhereTheTerminalDoesNotKnow) {
  const OwnTerminal own(0);
  ::setenv("COLUMNS", "33", 1);
  EXPECT_EQ(window_columns(), 33);
  for (const char* nonsense : {"", "wide", "0", "-5", "12x", "99999999999999999999"}) {
    ::setenv("COLUMNS", nonsense, 1);
    EXPECT_EQ(window_columns(), 80) << nonsense;
  }
  ::unsetenv("COLUMNS");
  EXPECT_EQ(window_columns(), 80);
  own.resize(47);
  ::setenv("COLUMNS", "33", 1);
  EXPECT_EQ(window_columns(), 47);
  ::unsetenv("COLUMNS");
}

TEST(TimeLeft, OfOnePhaseIsItsOwn) {
  TimeLeft time;
  time.begin("convert");
  EXPECT_EQ(time.seconds(0, 0, 5), std::nullopt);
  EXPECT_DOUBLE_EQ(*time.seconds(0.25, 0, 5), 15);
  // Half was there from an earlier run, and took no time of this one.
  EXPECT_DOUBLE_EQ(*time.seconds(0.75, 0.5, 5), 5);
}

TEST(TimeLeft, IsThatOfTheWholeRun) {
  TimeLeft time;
  time.expect({{"survey", 10}, {"mesh", 100}});
  time.begin("survey");
  EXPECT_NEAR(*time.seconds(0.5, 0, 5), 105, 1e-9);
  EXPECT_NEAR(*time.seconds(0, 0, 1), 109, 1e-9);
  time.end(0, 12);
  time.correct({.name = "mesh", .seconds = 300});
  time.begin("mesh");
  EXPECT_NEAR(*time.seconds(0, 0, 0), 300, 1e-9);
  EXPECT_NEAR(*time.seconds(0.9, 0, 27), 3, 1.5) << "what is measured counts more and more";
  time.end(0, 30);
}

TEST(TimeLeft, LearnsFromPhasesOfTheSameName) {
  TimeLeft time;
  time.expect({{"survey", 0}, {"mesh", 10}, {"survey", 0}, {"mesh", 40}});
  time.begin("survey");
  EXPECT_EQ(time.seconds(0.5, 0, 5), std::nullopt) << "nobody knows how long the second one takes";
  time.end(0, 10);
  time.begin("mesh");
  time.end(0, 30);
  time.begin("survey");
  EXPECT_NEAR(*time.seconds(0, 0, 0), 10 + 120, 1e-9);
}

TEST(TimeLeft, ARunInsideAnotherOneHasNoSay) {
  TimeLeft time;
  time.expect({{"mesh", 10}, {"verify", 7}});
  time.expect({{"mesh", 1}});
  time.begin("mesh");
  EXPECT_NEAR(*time.seconds(0, 0, 0), 17, 1e-9);
}

TEST(TimeLeft, UnitsMayWeighDifferently) {
  TimeLeft time;
  time.expect({{.name = "mesh", .seconds = 0, .share = [](std::int64_t done) {
                  return done == 0 ? 0.0 : 0.5 + 0.5 * static_cast<double>(done - 1) / 9;
                }}});
  time.begin("mesh");
  EXPECT_DOUBLE_EQ(time.share_of(1, 10), 0.5);
  EXPECT_DOUBLE_EQ(*time.seconds(time.share_of(1, 10), 0, 6), 6);
}

TEST(Progress, WhatNeededNoWorkIsDoneButMakesNothingFaster) {
  std::string seen;
  {
    const OwnTerminal own(40);
    Progress progress(quick(ProgressStyle::kJsonLines));
    const Phase phase(
        progress, {.name = "mesh", .unit = "tiles", .total = 1'000'000, .done_before = 900'000});
    progress.skip(50'000);
    progress.advance(1);
    for (int tries = 0; tries < 10000 && seen.find("950001") == std::string::npos; ++tries) {
      seen += own.read();
      ::usleep(500);
    }
  }
  EXPECT_THAT(seen, HasSubstr(R"("done":950001,"done_before":950000)"));
  const std::string rate = R"("rate_per_s":)";
  EXPECT_LT(std::stod(seen.substr(seen.rfind(rate) + rate.size())), 1e6);
}

TEST(Progress, JsonLinesTellBuffersAndTheTimeOfTheRun) {
  std::string seen;
  {
    const OwnTerminal own(40);
    Progress progress(quick(ProgressStyle::kJsonLines));
    progress.expect({{"survey", 0}, {"mesh", 1000}});
    const Phase phase(progress, {.name = "survey", .unit = "posts", .total = 10, .fills = [] {
                                   return std::vector<BufferFill>{{"ready", 2, 7}};
                                 }});
    progress.advance(5);
    for (int tries = 0; tries < 10000 && seen.find("run_left_s") == std::string::npos; ++tries) {
      seen += own.read();
      ::usleep(500);
    }
  }
  EXPECT_THAT(seen, HasSubstr(R"("buffers":{"ready":{"capacity":7,"filled":2}})"));
  EXPECT_THAT(seen, HasSubstr(R"("run_left_s":1000.)"));
}

}  // namespace
}  // namespace qmpipe::progress_test
