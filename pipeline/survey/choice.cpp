#include "pipeline/survey/choice.h"

#include <algorithm>
#include <atomic>
#include <exception>

#include "formats/bytes/errors.h"
#include "formats/sources/joined_grids.h"
#include "pipeline/survey/in_order.h"

namespace qmpipe {

std::int32_t chosen_sampling_zoom(const SurveyChoice& choice,
                                  const std::vector<RasterInfo>& sources) {
  if (choice.sampling_zoom >= 0) return choice.sampling_zoom;
  return std::max(sampling_zoom_for(choice.scheme, sources), choice.max_zoom);
}

std::vector<RasterInfo> describe_inputs(const SurveyChoice& choice) {
  if (choice.inputs.empty()) throw UsageError("no input: name at least one raster");
  std::vector<RasterInfo> infos(choice.inputs.size());
  // The first input that cannot be used is told, whichever thread met one first.
  std::vector<std::exception_ptr> errors(infos.size());
  std::atomic<std::size_t> first_wrong = infos.size();
  for_each_in_order(choice.threads, infos.size(), [&](std::size_t k) {
    if (k > first_wrong) return;
    try {
      infos[k] = RasterSource::open(choice.inputs[k],
                                    {.crs_override = choice.source_crs, .heights = choice.heights})
                     ->info();
    } catch (...) {
      errors[k] = std::current_exception();
      std::size_t before = first_wrong;
      while (k < before && !first_wrong.compare_exchange_weak(before, k)) {
      }
    }
  });
  if (first_wrong < infos.size()) std::rethrow_exception(errors[first_wrong]);
  join_grids(infos);
  return infos;
}

}  // namespace qmpipe
