// Any text: parse_layer_json() does not throw. What it accepts is written and read back equal.
#include "formats/tile/layer_json.h"

#include <cstdint>
#include <cstdlib>
#include <string>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto parsed = qmpipe::parse_layer_json(std::string(data, data + size));
  if (!parsed.ok()) return 0;
  const auto again = qmpipe::parse_layer_json(qmpipe::write_layer_json(parsed->layer));
  if (!again.ok() || again->layer != parsed->layer) std::abort();
  return 0;
}
