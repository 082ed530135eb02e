// A whole file of a detail-increment model without its seal, which is made anew, so that changes reach
// what lies behind it: read, it gives a model that is written and read again equal, or an error.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "formats/bytes/seal.h"
#include "formats/detail_model/arrays.h"
#include "formats/detail_model/file.h"
#include "tests/fuzz/file_in_memory.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const qmpipe::fuzz::FileInMemory file(".h5");
  std::vector<std::uint8_t> bytes(data, data + size);
  qmpipe::append_seal(bytes, {});
  file.put(bytes);
  const auto summary = qmpipe::read_detail_summary(file.path());
  const auto model = qmpipe::read_detail_file(file.path());
  if (!model) return 0;
  if (!summary || qmpipe::summary_of(*model) != *summary) std::abort();
  const auto again = qmpipe::decode_detail(*summary, qmpipe::encode_detail(*model));
  if (!again || *again != *model) std::abort();
  return 0;
}
