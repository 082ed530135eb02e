// Does a tile set work for viewers, as a web server serves it? Asks for layer.json and a sample of
// tiles as CesiumJS would, and says in plain words what is wrong, what a viewer shows then, and what
// to do.
//
// Guarantees: whatever the answers hold, it ends with a report, which depends on them alone: the
// sample is the same each time. Asks for at most options.most_tiles tiles, and for a few more
// answers to find out why something is missing; gives up on a server that leaves several tiles
// without an answer. What it cannot do: a sample proves nothing about the other tiles (`qmpipe
// verify` reads them all, from a folder), and no browser is asked.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/web_check/check_finding.h"
#include "pipeline/web_check/http_answer.h"

namespace qmpipe::web_check {

struct CheckOptions {
  // REQUIRES: >= 1.
  std::size_t most_tiles = 40;
  // Origin of the page that shows the tiles ("https://host:port"); what it may not load is a fault.
  // DEFAULT: some other site, and then it is a warning.
  std::string origin = {};
};

struct CheckReport {
  std::string layer_url;
  // False when layer.json could not be asked for at all: nobody answered.
  bool is_answered = false;
  std::int64_t tiles_asked = 0;
  std::int64_t tiles_sound = 0;        // of these, those without a fault
  std::int32_t deepest_zoom = 0;       // of the tiles that decode, however they were sent
  std::vector<CheckFinding> findings;  // faults first

  std::int64_t count(CheckSeverity severity) const;
};

// `address`: of the set's folder or of its layer.json. Throws UsageError for what is no http or
// https address, there or in the options; what `fetch` throws.
CheckReport check_url(const std::string& address, const CheckOptions& options, const Fetch& fetch);

// For people; for programs: one JSON object, whose keys and codes are stable.
std::string text_of(const CheckReport& report);
std::string json_of(const CheckReport& report);

}  // namespace qmpipe::web_check
