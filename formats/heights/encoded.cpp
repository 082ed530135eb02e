#include "formats/heights/encoded.h"

#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "formats/bytes/errors.h"

namespace qmpipe {
namespace {

constexpr int kColours = 3;

float height_m(HeightEncoding encoding, int red, int green, int blue) {
  const double number = red * 65536.0 + green * 256.0 + blue;
  return static_cast<float>(encoding == HeightEncoding::kTerrainRgb ? number * 0.1 - 10000
                                                                    : number / 256 - 32768);
}

class EncodedBand final : public GDALRasterBand {
 public:
  EncodedBand(GDALDataset& owner, GDALDataset& picture, HeightEncoding encoding)
      : picture_(picture), first_(*picture.GetRasterBand(1)), encoding_(encoding) {
    poDS = &owner;
    nBand = 1;
    eDataType = GDT_Float32;
    nRasterXSize = picture.GetRasterXSize();
    nRasterYSize = picture.GetRasterYSize();
    first_.GetBlockSize(&nBlockXSize, &nBlockYSize);
    int is_set = 0;
    const double value = first_.GetNoDataValue(&is_set);
    if (is_set != 0) void_colour_ = value;
  }

  GDALRasterBand* GetMaskBand() override {
    return has_own_mask() ? first_.GetMaskBand() : GDALRasterBand::GetMaskBand();
  }
  int GetMaskFlags() override {
    return has_own_mask() ? first_.GetMaskFlags() : GDALRasterBand::GetMaskFlags();
  }

 protected:
  CPLErr IReadBlock(int block_column, int block_row, void* image) override {
    const int column = block_column * nBlockXSize;
    const int row = block_row * nBlockYSize;
    const int width = std::min(nBlockXSize, nRasterXSize - column);
    const int height = std::min(nBlockYSize, nRasterYSize - row);
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    colours_.resize(pixels * kColours);
    std::array<int, kColours> bands = {1, 2, 3};
    const CPLErr result = picture_.RasterIO(GF_Read, column, row, width, height, colours_.data(),
                                            width, height, GDT_Byte, kColours, bands.data(),
                                            kColours, std::int64_t{kColours} * width, 1, nullptr);
    if (result != CE_None) return result;
    auto* const heights = static_cast<float*>(image);
    for (int r = 0; r < height; ++r) {
      for (int c = 0; c < width; ++c) {
        const std::size_t from = static_cast<std::size_t>(r) * static_cast<std::size_t>(width) +
                                 static_cast<std::size_t>(c);
        heights[static_cast<std::ptrdiff_t>(r) * nBlockXSize + c] =
            decode(std::span(colours_).subspan(from * kColours, kColours));
      }
    }
    return CE_None;
  }

 private:
  // Alpha or a mask of the picture; a void value of one band alone is no mask of heights.
  bool has_own_mask() { return (first_.GetMaskFlags() & GMF_PER_DATASET) != 0; }

  float decode(std::span<const std::uint8_t> colours) const {
    if (void_colour_ && std::all_of(colours.begin(), colours.end(),
                                    [this](std::uint8_t c) { return c == *void_colour_; })) {
      return std::numeric_limits<float>::quiet_NaN();
    }
    return height_m(encoding_, colours[0], colours[1], colours[2]);
  }

  GDALDataset& picture_;
  GDALRasterBand& first_;
  HeightEncoding encoding_;
  std::optional<double> void_colour_;
  std::vector<std::uint8_t> colours_;  // of the block in hand
};

class EncodedDataset final : public GDALDataset {
 public:
  EncodedDataset(GDALDataset& picture, HeightEncoding encoding) {
    nRasterXSize = picture.GetRasterXSize();
    nRasterYSize = picture.GetRasterYSize();
    SetBand(1, new EncodedBand(*this, picture, encoding));
  }
};

bool has_loss(GDALDataset& picture) {
  const auto item = [&picture](const char* name) {
    const char* const value = picture.GetMetadataItem(name, "IMAGE_STRUCTURE");
    return std::string(value != nullptr ? value : "");
  };
  const GDALDriver* const driver = picture.GetDriver();
  return (driver != nullptr && std::string(driver->GetDescription()) == "JPEG") ||
         item("COMPRESSION").find("JPEG") != std::string::npos ||
         item("COMPRESSION_REVERSIBILITY").starts_with("LOSSY");
}

bool has_three_colours(GDALDataset& dataset) {
  if (dataset.GetRasterCount() < kColours) return false;
  for (int band = 1; band <= kColours; ++band) {
    if (dataset.GetRasterBand(band)->GetRasterDataType() != GDT_Byte) return false;
  }
  return true;
}

struct ColourRange {
  int low = 255;
  int high = 0;
  int spread() const { return high - low; }
};

}  // namespace

bool is_picture(GDALDataset& dataset) {
  GDALRasterBand& first = *dataset.GetRasterBand(1);
  const GDALDataType type = first.GetRasterDataType();
  if (type != GDT_Byte && type != GDT_UInt16) return false;
  if (first.GetColorInterpretation() == GCI_PaletteIndex) return first.GetColorTable() != nullptr;
  // Three bands of 8 bits, or four, are one whatever they say.
  if (has_three_colours(dataset) && dataset.GetRasterCount() <= kColours + 1) return true;
  return first.GetColorInterpretation() >= GCI_RedBand &&
         first.GetColorInterpretation() != GCI_AlphaBand;
}

std::optional<HeightEncoding> likely_encoding(GDALDataset& picture) {
  if (!has_three_colours(picture)) return std::nullopt;
  constexpr int kSide = 64;
  const int width = std::min(kSide, picture.GetRasterXSize());
  const int height = std::min(kSide, picture.GetRasterYSize());
  std::vector<std::uint8_t> colours(static_cast<std::size_t>(width) *
                                    static_cast<std::size_t>(height) * kColours);
  std::array<int, kColours> bands = {1, 2, 3};
  if (picture.RasterIO(GF_Read, 0, 0, picture.GetRasterXSize(), picture.GetRasterYSize(),
                       colours.data(), width, height, GDT_Byte, kColours, bands.data(), kColours,
                       std::int64_t{kColours} * width, 1, nullptr) != CE_None) {
    return std::nullopt;
  }
  std::array<ColourRange, kColours> ranges;
  for (std::size_t k = 0; k < colours.size(); ++k) {
    ColourRange& range = ranges.at(k % kColours);
    range.low = std::min(range.low, int{colours[k]});
    range.high = std::max(range.high, int{colours[k]});
  }
  // The first colour changes every 6553.6 m or 256 m, the last one from pixel to pixel.
  if (ranges[2].spread() < 50) return std::nullopt;
  if (ranges[0].high <= 2) return HeightEncoding::kTerrainRgb;
  const bool is_on_earth = ranges[0].low >= 84 && ranges[0].high <= 163;
  if (is_on_earth && ranges[0].spread() <= 36) return HeightEncoding::kTerrarium;
  return std::nullopt;
}

std::unique_ptr<GDALDataset, CloseDataset> decode_heights(GDALDataset& picture,
                                                          const std::string& path,
                                                          HeightEncoding encoding) {
  if (!has_three_colours(picture)) {
    throw IoError(
        "cannot decode the heights of", path,
        "it has no three bands of 8 bits, which --encoding " + name_of(encoding) + " is made of",
        "leave out --encoding, or give the picture as it was made");
  }
  if (has_loss(picture)) {
    throw IoError("cannot decode the heights of", path,
                  "it is compressed with loss, so that its colours are no exact numbers",
                  "get it as PNG or another form without loss");
  }
  return std::unique_ptr<GDALDataset, CloseDataset>(new EncodedDataset(picture, encoding));
}

}  // namespace qmpipe
