#include "formats/bytes/printable.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <clocale>
#include <cwchar>
#include <nlohmann/json.hpp>
#include <random>

namespace qmpipe::printable_test {
namespace {

TEST(Printable, ControlCharactersAndTurnsOfDirectionAreSpelt) {
  EXPECT_EQ(printable("a\x1b[31mred\x07\r\x7f"), "a\\u001b[31mred\\u0007\\u000d\\u007f");
  EXPECT_EQ(printable(std::string(1, '\0')), "\\u0000");
  // CSI as one character of C1, as a byte that is no UTF-8, and marks of direction.
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "\\u009b31m");
  EXPECT_EQ(printable("\x9b"
                      "31m"),
            "\\x9b31m");
  EXPECT_EQ(printable("\xe2\x80\xae"
                      "gpj.\xe2\x81\xa9\xd8\x9c\xe2\x80\xa8"),
            "\\u202egpj.\\u2069\\u061c\\u2028");
}

TEST(Printable, OrdinaryTextStaysAsItIs) {
  const std::string text = "Zürich, 高さ (m), Ω — 𝔻\n\tnext";
  EXPECT_EQ(printable(text), text);
}

TEST(Printable, BytesThatAreNoUtf8AreSpelt) {
  // Too long, half a pair, beyond the last one, cut off.
  EXPECT_EQ(printable("\xc0\x9b"), "\\xc0\\x9b");
  EXPECT_EQ(printable("\xe0\x82\x9b"), "\\xe0\\x82\\x9b");
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");
  EXPECT_EQ(printable("caf\xe9"), "caf\\xe9");
  EXPECT_EQ(printable("\xe2\x82"), "\\xe2\\x82");
}

TEST(Printable, PiecesGiveWhatTheWholeGives) {
  const std::string parts[] = {"a",  "\xc3", "\xa9",    "\xe2\x80\xae", "\x1b", "\xf0\x9d\x94\xbb",
                               "\n", "\x9b", "\xe2\x82"};
  for (unsigned seed = 0; seed < 3000; ++seed) {
    std::mt19937 random(seed);
    std::string whole;
    for (auto n = random() % 12; n > 0; --n) whole += parts[random() % std::size(parts)];
    PrintableFilter filter;
    std::string shown;
    for (std::size_t at = 0; at < whole.size();) {
      const std::size_t bytes = 1 + random() % 3;
      shown += filter.pass(std::string_view(whole).substr(at, bytes));
      at += bytes;
    }
    ASSERT_EQ(shown + filter.finish(), printable(whole)) << "seed " << seed;
  }
}

TEST(Printable, JsonStaysTheSameJson) {
  const nlohmann::json value = {{"name", "\x1b\x7f\xc2\x9b\xe2\x80\xae ok"}};
  EXPECT_EQ(nlohmann::json::parse(printable(value.dump())), value);
}

TEST(Printable, NoLineOfAMessageOrValuePassesForAnother) {
  EXPECT_EQ(printable_line("a\nqmpipe: done\tx"), "a\\nqmpipe: done\\tx");
  EXPECT_EQ(printable_message("cannot open\n  Check it.\nqmpipe: done"),
            "cannot open\n  Check it.\n  qmpipe: done");
}

std::string utf8(char32_t code) {
  if (code < 0x80) return {static_cast<char>(code)};
  std::string text;
  int rest = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
  const unsigned lead = rest == 1 ? 0xC0 : rest == 2 ? 0xE0 : 0xF0;
  text += static_cast<char>(lead | code >> (6 * rest));
  while (--rest >= 0) text += static_cast<char>(0x80U | (code >> (6 * rest) & 0x3FU));
  return text;
}

TEST(Columns, NoCharacterTakesMoreThanItCounts) {
  const std::string before = std::setlocale(LC_CTYPE, nullptr);
  if (std::setlocale(LC_CTYPE, "C.UTF-8") == nullptr) GTEST_SKIP() << "there is no locale C.UTF-8";
  for (char32_t code = 0x20; code <= 0x10FFFF; ++code) {
    if (code >= 0xD800 && code < 0xE000) continue;
    const auto counted = columns_of(utf8(code));
    ASSERT_TRUE(counted == 1 || counted == 2) << std::hex << std::uint32_t{code};
    ASSERT_GE(counted, ::wcwidth(static_cast<wchar_t>(code))) << std::hex << std::uint32_t{code};
  }
  std::setlocale(LC_CTYPE, before.c_str());
}

TEST(Columns, OrdinaryTextCountsExactly) {
  EXPECT_EQ(columns_of("mesh: 12 % \u00e9\u00fc\u03a9\u2014\u2026"), 16);
  EXPECT_EQ(columns_of("\u9ad8\u3055 \U0001f5fb"), 7);
}

TEST(Columns, ACutLineFitsAndLacksNoCharacterThatWouldFit) {
  const std::string parts[] = {"a", "\u00e9", "\u9ad8", "\U0001f5fb", " ", "\U0001d53b"};
  for (unsigned seed = 0; seed < 2000; ++seed) {
    std::mt19937 random(seed);
    std::string line;
    for (auto n = random() % 30; n > 0; --n) line += parts[random() % std::size(parts)];
    const auto columns = static_cast<std::int64_t>(random() % 40);
    const std::string cut = cut_to_columns(line, columns);
    ASSERT_TRUE(line.starts_with(cut)) << "seed " << seed;
    ASSERT_EQ(printable(cut), cut) << "half a character, seed " << seed;
    ASSERT_LE(columns_of(cut), columns) << "seed " << seed;
    if (cut != line) {
      ASSERT_GE(columns_of(cut), columns - 1) << "seed " << seed;
    }
  }
}

}  // namespace
}  // namespace qmpipe::printable_test
