// Any bytes: read_las_header() neither throws nor reads outside the source, and a header it accepts
// gives as many points as it says.
#include "formats/points/las_file.h"

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using Bytes = std::vector<std::uint8_t>;
  const qmpipe::ByteSource source{
      .size_bytes = size,
      .read = [&](std::uint64_t offset, std::size_t count) -> qmpipe::Result<Bytes> {
        if (offset > size || count > size - offset) std::abort();
        return Bytes(data + offset, data + offset + count);
      }};
  const auto header = qmpipe::read_las_header(source);
  if (!header.ok()) return 0;
  std::uint64_t points = 0;
  const auto error =
      qmpipe::for_each_las_point(source, *header, [&](const qmpipe::LasPoint& point) {
        ++points;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          if (!std::isfinite(header->offset[axis] + header->scale[axis] * point.at[axis]))
            std::abort();
        }
      });
  if (error || points != header->point_count) std::abort();
  return 0;
}
