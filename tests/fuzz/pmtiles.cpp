// Any file: reading its header and directories does not throw. What is accepted is written and
// read back equal.
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "formats/pmtiles/directory.h"

namespace {

using qmpipe::Error;
using qmpipe::PmtilesIndex;
using qmpipe::Result;
using Bytes = std::vector<std::uint8_t>;

Result<PmtilesIndex> index_of(std::span<const std::uint8_t> file) {
  const auto read = [file](std::uint64_t offset, std::uint64_t bytes) -> Result<Bytes> {
    if (offset > file.size() || bytes > file.size() - offset) return Error{"outside the file"};
    const auto part = file.subspan(offset, bytes);
    return Bytes(part.begin(), part.end());
  };
  return qmpipe::read_pmtiles_index(read, file.size());
}

void demand(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto index = index_of({data, size});
  if (!index.ok() || index->entries.empty()) return 0;
  const auto again =
      qmpipe::read_pmtiles_directory(qmpipe::write_pmtiles_directory(index->entries));
  demand(again.ok() && *again == index->entries);
  const auto header = qmpipe::write_pmtiles_header(index->header);
  const auto header_again = qmpipe::read_pmtiles_header(header, size);
  demand(header_again.ok() && qmpipe::write_pmtiles_header(*header_again) == header);
  const qmpipe::PmtilesDirectories directories = qmpipe::write_pmtiles_directories(index->entries);
  demand(qmpipe::kPmtilesHeaderBytes + directories.root.size() < qmpipe::kPmtilesRootEnd);
  return 0;
}
