// What a build has made, zoom by zoom: report.json, and the table a person sees.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "formats/raster/block_cache.h"
#include "pipeline/build/tile_builder.h"

namespace qmpipe {

struct BuiltZoom {
  std::int32_t zoom = 0;
  std::optional<double> tolerance_m;  // where the method holds one
  double height_step_m = 0;
  ParameterValues parameters;
  std::int64_t tiles = 0;
  std::int64_t vertices = 0;
  std::int64_t triangles = 0;
  std::int64_t plain_bytes = 0;
  std::int64_t stored_bytes = 0;
  ErrorSummary error;
  StageSeconds seconds{};  // of all threads

  void add(const TileWork& work);
};

struct BuildReport {
  Method method = Method::kGreedy;
  Stop stop = Stop::kTolerance;
  std::vector<BuiltZoom> zooms;
  std::int64_t tiles = 0;
  std::int64_t stored_bytes = 0;
  std::int64_t resumed_tiles = 0;  // of all, those that interrupted runs had done
  std::uint64_t content_hash = 0;  // the same for the same tiles in any order
  SourceReads source_reads;
  double survey_s = 0;
  double mesh_s = 0;
  std::int32_t threads = 0;
  std::int32_t largest_in_flight = 0;
  std::int32_t max_in_flight = 0;
  std::int64_t expected_peak_bytes = 0;
  std::int64_t peak_resident_bytes = 0;
  std::string built_from;     // JSON: pipeline/recipe/fingerprint.h, provenance_of()
  std::string layer_version;  // of the layer.json that it belongs to

  void add(const TileWork& work);
};

// Times and memory of this run are in the report, and only there: it is no part of the tile set.
std::string write_report(const BuildReport& report);
std::string report_table(const BuildReport& report);
// Why coarse zooms are as far off as the table says, where a zoom's tolerance is a kilometre or more;
// else empty.
std::string coarse_zooms_text(double largest_tolerance_m);
// "1234 blocks, each decoded 1.02 times"
std::string source_reads_text(const SourceReads& reads);

}  // namespace qmpipe
