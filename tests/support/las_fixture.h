// LAS files written byte by byte from the specification's tables, without our reader's help.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/points/las_file.h"

namespace qmpipe::testing {

struct LasFixturePoint {
  std::array<std::int32_t, 3> at{};
  std::uint8_t classification = 1;
  bool is_withheld = false;
};

struct LasFixture {
  int minor_version = 4;
  int format = 6;
  std::array<double, 3> scale = {0.01, 0.01, 0.01};
  std::array<double, 3> offset{};
  std::vector<LasFixturePoint> points = {};
  std::size_t extra_bytes = 0;  // of each point
  std::string wkt = {};
  bool wkt_at_end = false;  // in an extended record
  std::vector<std::uint16_t> geo_keys = {};
  std::vector<double> geo_doubles = {};
};

// Fields that no test is about hold 0xA5, so that a wrong offset shows.
std::vector<std::uint8_t> las_bytes(const LasFixture& fixture);

ByteSource source_of(const std::vector<std::uint8_t>& bytes);

}  // namespace qmpipe::testing
