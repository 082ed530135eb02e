#include "formats/run_store/block_codec.h"

#include <fmt/format.h>
#include <zstd.h>

#include <bit>
#include <mutex>
#include <new>

#include "scheduler/block_key.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::size_t kPlainBytes = kBlockSize * sizeof(float);

struct FreeContexts {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

struct Workspace {
  std::unique_ptr<ZSTD_CCtx, FreeContexts> packer;
  std::unique_ptr<ZSTD_DCtx, FreeContexts> unpacker;
  std::vector<std::uint8_t> planes = std::vector<std::uint8_t>(kPlainBytes);
  std::vector<std::uint8_t> chunk;
};

// Byte k of all heights, least significant first, then byte k + 1 of all.
void shuffle(std::span<const float> heights_m, std::vector<std::uint8_t>& planes) {
  std::uint8_t* plane = planes.data();
  for (std::size_t n = 0; n < kBlockSize; ++n) {
    const auto bits = std::bit_cast<std::uint32_t>(heights_m[n]);
    plane[n] = static_cast<std::uint8_t>(bits);
    plane[n + kBlockSize] = static_cast<std::uint8_t>(bits >> 8U);
    plane[n + 2 * kBlockSize] = static_cast<std::uint8_t>(bits >> 16U);
    plane[n + 3 * kBlockSize] = static_cast<std::uint8_t>(bits >> 24U);
  }
}

std::vector<float> unshuffle(const std::vector<std::uint8_t>& planes) {
  std::vector<float> heights_m(kBlockSize);
  const std::uint8_t* plane = planes.data();
  for (std::size_t n = 0; n < kBlockSize; ++n) {
    heights_m[n] =
        std::bit_cast<float>(static_cast<std::uint32_t>(plane[n]) |
                             static_cast<std::uint32_t>(plane[n + kBlockSize]) << 8U |
                             static_cast<std::uint32_t>(plane[n + 2 * kBlockSize]) << 16U |
                             static_cast<std::uint32_t>(plane[n + 3 * kBlockSize]) << 24U);
  }
  return heights_m;
}

}  // namespace

struct BlockCodec::Impl {
  explicit Impl(int level_) : level(level_) {}

  std::unique_ptr<Workspace> take() {
    const std::scoped_lock lock(mutex);
    if (idle.empty()) return std::make_unique<Workspace>();
    std::unique_ptr<Workspace> workspace = std::move(idle.back());
    idle.pop_back();
    return workspace;
  }
  void give_back(std::unique_ptr<Workspace> workspace) {
    const std::scoped_lock lock(mutex);
    idle.push_back(std::move(workspace));
  }

  int level;
  std::mutex mutex;
  std::vector<std::unique_ptr<Workspace>> idle;
};

BlockCodec::BlockCodec(int level) : impl_(std::make_unique<Impl>(level)) {
  QMPIPE_CHECK(level >= 1 && level <= 19);
}

BlockCodec::~BlockCodec() = default;

std::size_t BlockCodec::largest_chunk_bytes() { return ZSTD_compressBound(kPlainBytes); }

std::vector<std::uint8_t> BlockCodec::compress(std::span<const float> heights_m) const {
  QMPIPE_CHECK(heights_m.size() == kBlockSize);
  std::unique_ptr<Workspace> workspace = impl_->take();
  if (workspace->packer == nullptr) workspace->packer.reset(ZSTD_createCCtx());
  if (workspace->packer == nullptr) throw std::bad_alloc();
  workspace->chunk.resize(largest_chunk_bytes());
  shuffle(heights_m, workspace->planes);
  const std::size_t packed_bytes =
      ZSTD_compressCCtx(workspace->packer.get(), workspace->chunk.data(), workspace->chunk.size(),
                        workspace->planes.data(), kPlainBytes, impl_->level);
  if (ZSTD_isError(packed_bytes) != 0) throw std::bad_alloc();
  std::vector<std::uint8_t> chunk(
      workspace->chunk.begin(),
      workspace->chunk.begin() + static_cast<std::ptrdiff_t>(packed_bytes));
  impl_->give_back(std::move(workspace));
  return chunk;
}

Result<std::vector<float>> BlockCodec::decompress(std::span<const std::uint8_t> chunk) const {
  std::unique_ptr<Workspace> workspace = impl_->take();
  if (workspace->unpacker == nullptr) workspace->unpacker.reset(ZSTD_createDCtx());
  if (workspace->unpacker == nullptr) throw std::bad_alloc();
  const std::size_t plain_bytes = ZSTD_decompressDCtx(
      workspace->unpacker.get(), workspace->planes.data(), kPlainBytes, chunk.data(), chunk.size());
  if (ZSTD_isError(plain_bytes) != 0) {
    return Error{fmt::format("it does not decompress: {}", ZSTD_getErrorName(plain_bytes))};
  }
  if (plain_bytes != kPlainBytes) {
    return Error{fmt::format("it holds {} bytes instead of {}", plain_bytes, kPlainBytes)};
  }
  std::vector<float> heights_m = unshuffle(workspace->planes);
  impl_->give_back(std::move(workspace));
  return heights_m;
}

}  // namespace qmpipe
