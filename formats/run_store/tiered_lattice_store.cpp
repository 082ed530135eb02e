#include "formats/run_store/tiered_lattice_store.h"

#include "scheduler/check.h"

namespace qmpipe {
namespace {

class TieredLatticeStore final : public LatticeStore {
 public:
  TieredLatticeStore(std::unique_ptr<LatticeStore> coarse, std::int32_t last_coarse_zoom,
                     std::unique_ptr<LatticeStore> deep)
      : coarse_(std::move(coarse)), deep_(std::move(deep)), last_coarse_zoom_(last_coarse_zoom) {}

  void put_block(const BlockKey& block, std::span<const float> heights_m) override {
    store_of(block.zoom).put_block(block, heights_m);
  }
  bool has_block(const BlockKey& block) const override {
    return store_of(block.zoom).has_block(block);
  }
  void read(const Lattice& lattice, const PostWindow& window, std::span<float> out) const override {
    store_of(lattice.zoom()).read(lattice, window, out);
  }
  void seal() override {
    coarse_->seal();
    deep_->seal();
  }
  std::int64_t memory_bytes() const override {
    return coarse_->memory_bytes() + deep_->memory_bytes();
  }

 private:
  LatticeStore& store_of(std::int32_t zoom) const {
    return zoom <= last_coarse_zoom_ ? *coarse_ : *deep_;
  }

  std::unique_ptr<LatticeStore> coarse_;
  std::unique_ptr<LatticeStore> deep_;
  std::int32_t last_coarse_zoom_;
};

}  // namespace

std::unique_ptr<LatticeStore> make_tiered_lattice_store(std::unique_ptr<LatticeStore> coarse,
                                                        std::int32_t last_coarse_zoom,
                                                        std::unique_ptr<LatticeStore> deep) {
  QMPIPE_CHECK(coarse != nullptr && deep != nullptr);
  return std::make_unique<TieredLatticeStore>(std::move(coarse), last_coarse_zoom, std::move(deep));
}

}  // namespace qmpipe
