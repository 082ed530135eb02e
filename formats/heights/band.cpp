#include "formats/heights/band.h"

#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/heights/encoded.h"

namespace qmpipe {
namespace {

[[noreturn]] void refuse_picture(GDALDataset& dataset, const std::string& path) {
  const bool has_palette = dataset.GetRasterBand(1)->GetColorTable() != nullptr;
  const std::string as_numbers = "if the numbers of one band are heights: --band 1";
  if (has_palette) {
    throw IoError("cannot read heights from", path,
                  "it is a picture: its numbers are places in a table of colours", as_numbers);
  }
  const auto likely = likely_encoding(dataset);
  std::string encodings;
  for (const HeightEncoding encoding : {HeightEncoding::kTerrainRgb, HeightEncoding::kTerrarium}) {
    encodings += (encodings.empty() ? "" : " or ") + ("--encoding " + name_of(encoding));
    if (likely == encoding) encodings += " (which they look like)";
  }
  throw IoError("cannot read heights from", path, "it is a picture: its bands are colours",
                "if the colours encode heights: " + encodings + "; " + as_numbers);
}

GDALRasterBand* band_numbered(GDALDataset& dataset, const std::string& path, int number) {
  if (number <= dataset.GetRasterCount()) return dataset.GetRasterBand(number);
  throw IoError("cannot read heights from", path,
                fmt::format("--band {} is not there; it has {}", number,
                            dataset.GetRasterCount() == 1
                                ? std::string("one band")
                                : fmt::format("{} bands", dataset.GetRasterCount())),
                "list them with: gdalinfo " + path);
}

// "1 elevation, 2 uncertainty"; empty where bands have no names.
std::string names_of_bands(GDALDataset& dataset) {
  constexpr int kMost = 8;
  std::string names;
  for (int band = 1; band <= std::min(dataset.GetRasterCount(), kMost); ++band) {
    const std::string name = dataset.GetRasterBand(band)->GetDescription();
    if (!name.empty()) names += fmt::format("{}{} {}", names.empty() ? "" : ", ", band, name);
  }
  return names;
}

void note_other_bands(const OpenedRaster& opened, HeightBand& chosen) {
  GDALDataset& dataset = *opened.dataset;
  if (dataset.GetRasterCount() < 2 || opened.driver == "BAG" ||
      dataset.GetRasterBand(2)->GetColorInterpretation() == GCI_AlphaBand) {
    return;
  }
  const std::string names = names_of_bands(dataset);
  chosen.assumptions.push_back(
      fmt::format("the file has {} bands{}; the first is taken (--band 2 takes the second)",
                  dataset.GetRasterCount(), names.empty() ? "" : " (" + names + ")"));
}

}  // namespace

HeightBand height_band_of(const OpenedRaster& opened, const std::string& path,
                          const HeightOptions& options) {
  GDALDataset& dataset = *opened.dataset;
  HeightBand chosen;
  if (options.band) {
    chosen.band = band_numbered(dataset, path, *options.band);
  } else if (is_picture(dataset)) {
    if (!options.encoding) refuse_picture(dataset, path);
    chosen.decoded = decode_heights(dataset, path, *options.encoding);
    chosen.band = chosen.decoded->GetRasterBand(1);
  } else {
    chosen.band = dataset.GetRasterBand(1);
    note_other_bands(opened, chosen);
  }
  if (GDALDataTypeIsComplex(chosen.band->GetRasterDataType()) != 0) {
    throw IoError("cannot read heights from", path, "its values are complex numbers",
                  "write the part that holds heights with gdal_calc.py or gdal_translate");
  }
  return chosen;
}

}  // namespace qmpipe
