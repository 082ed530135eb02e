#include "formats/printable.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

namespace qmpipe {
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

}  // namespace
}  // namespace qmpipe
