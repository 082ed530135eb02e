// The journal keeps what was appended, drops what a crash tore, and refuses what was damaged.
#include "formats/bytes/journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "formats/bytes/errors.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::journal_test {
namespace {

using ::testing::ElementsAre;
using testing::FileSizeLimit;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TemporaryFolder;

std::vector<std::uint8_t> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

std::unique_ptr<Journal> open_sound(const TemporaryFolder& folder) {
  auto journal = Journal::open(folder.path() / "journal");
  EXPECT_TRUE(journal) << journal.error().message;
  return std::move(journal.value());
}

// A journal of a few lines, as bytes.
std::string written(const std::vector<std::string>& lines) {
  const TemporaryFolder folder;
  const auto journal = open_sound(folder);
  for (const std::string& line : lines) journal->append(line);
  return folder.get("journal");
}

TEST(Journal, KeepsItsLinesInOrder) {
  const TemporaryFolder folder;
  open_sound(folder)->append("first");
  {
    const auto journal = open_sound(folder);
    EXPECT_THAT(journal->lines(), ElementsAre("first"));
    journal->append("");
    journal->append("third {\"a\": 1}");
  }
  EXPECT_THAT(open_sound(folder)->lines(), ElementsAre("first", "", "third {\"a\": 1}"));
}

TEST(Journal, CutAnywhereItHoldsTheWholeLinesBeforeTheCut) {
  const std::string text = written({"one", "two two", "three"});
  std::size_t lines_before = 0;
  for (std::size_t cut = 0; cut <= text.size(); ++cut) {
    if (cut > 0 && text[cut - 1] == '\n') ++lines_before;
    const auto content = parse_journal(bytes_of(text.substr(0, cut)));
    ASSERT_TRUE(content) << content.error().message;
    EXPECT_EQ(content->lines.size(), lines_before) << cut;
  }
}

TEST(Journal, AppendsBehindTheLastWholeLineOfATornOne) {
  const TemporaryFolder folder;
  const std::string text = written({"one", "two"});
  folder.put("journal", text.substr(0, text.size() - 2));
  {
    const auto journal = open_sound(folder);
    EXPECT_THAT(journal->lines(), ElementsAre("one"));
    journal->append("other");
  }
  EXPECT_THAT(open_sound(folder)->lines(), ElementsAre("one", "other"));
  EXPECT_EQ(folder.get("journal"), written({"one", "other"}));
}

TEST(Journal, AnyChangedByteIsNoticed) {
  const std::string text = written({"one", "two two", "three"});
  std::mt19937 random(20261122);
  for (std::size_t at = 0; at < text.size(); ++at) {
    std::string damaged = text;
    damaged[at] = static_cast<char>(damaged[at] ^ static_cast<char>(1U << (random() % 8)));
    const auto content = parse_journal(bytes_of(damaged));
    // In the last line it may be what a crash left; never is a changed line believed.
    if (!content) continue;
    for (const std::string& line : content->lines) {
      EXPECT_THAT(line, ::testing::AnyOf("one", "two two", "three")) << at;
    }
    EXPECT_LT(content->lines.size(), 3U) << at;
  }
}

TEST(Journal, DamageBeforeASoundLineIsRefusedByNumber) {
  const TemporaryFolder folder;
  std::string text = written({"one", "two two", "three"});
  text[text.find("two")] = 'T';
  folder.put("journal", text);
  const auto journal = Journal::open(folder.path() / "journal");
  ASSERT_FALSE(journal);
  EXPECT_THAT(journal.error().message, HasSubstr("journal: line 2 is damaged"));
}

TEST(Journal, ALineTakenOutIsNoticed) {
  std::string text = written({"one", "two", "three"});
  const std::size_t end = text.find('\n') + 1;
  text.erase(end, text.find('\n', end) + 1 - end);
  const auto content = parse_journal(bytes_of(text));
  ASSERT_TRUE(content);
  EXPECT_THAT(content->lines, ElementsAre("one"));
}

TEST(Journal, OneAtATimeHasItOpen) {
  const TemporaryFolder folder;
  const auto journal = open_sound(folder);
  try {
    static_cast<void>(Journal::open(folder.path() / "journal"));
    FAIL() << "it was opened twice";
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(), HasSubstr("another run is at work with it"));
  }
}

// A real full file: the limit is the process's own.
TEST(Journal, AnAppendThatDoesNotFitLeavesWhatWasThere) {
  const TemporaryFolder folder;
  const auto journal = open_sound(folder);
  journal->append("one");
  std::string said;
  try {
    const FileSizeLimit limit(100);
    journal->append(std::string(500, 'x'));
  } catch (const IoError& error) {
    said = error.what();
  }
  EXPECT_THAT(said, HasSubstr("cannot write the journal"));
  journal->append("two");
  EXPECT_EQ(folder.get("journal"), written({"one", "two"}));
}

TEST(Journal, WhatIsNoJournalHoldsNoLines) {
  EXPECT_THAT(parse_journal({})->lines, IsEmpty());
  EXPECT_THAT(parse_journal(bytes_of("hello\nworld\n"))->lines, IsEmpty());
  EXPECT_THAT(parse_journal(std::vector<std::uint8_t>(5000, '\n'))->lines, IsEmpty());
}

}  // namespace
}  // namespace qmpipe::journal_test
