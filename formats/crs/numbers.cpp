#include "formats/crs/numbers.h"

#include <proj.h>

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace qmpipe {
namespace {

struct DestroyContext {
  void operator()(PJ_CONTEXT* context) const { proj_context_destroy(context); }
};
struct DestroyCrs {
  void operator()(PJ* crs) const { proj_destroy(crs); }
};

struct KnownCrs {
  std::array<int, 2> axes{};
  std::unique_ptr<PJ, DestroyCrs> crs;
};

}  // namespace

struct CrsNumbers::Impl {
  std::unique_ptr<PJ_CONTEXT, DestroyContext> context{proj_context_create()};
  std::vector<KnownCrs> known;  // by number
  // Files of one survey most often have it in the same words.
  std::map<std::pair<std::string, std::array<int, 2>>, std::size_t> by_words;
};

CrsNumbers::CrsNumbers() : impl_(std::make_unique<Impl>()) {
  proj_log_level(impl_->context.get(), PJ_LOG_NONE);
}
CrsNumbers::~CrsNumbers() = default;

std::size_t CrsNumbers::number_of(const CrsText& crs) {
  const auto [entry, is_new] =
      impl_->by_words.try_emplace({crs.wkt, crs.axes}, impl_->known.size());
  if (!is_new) return entry->second;
  PJ_CONTEXT* const context = impl_->context.get();
  KnownCrs one{.axes = crs.axes, .crs = {}};
  one.crs.reset(proj_create(context, crs.wkt.c_str()));
  const auto same =
      std::find_if(impl_->known.begin(), impl_->known.end(), [&](const KnownCrs& other) {
        return one.crs && other.crs && one.axes == other.axes &&
               proj_is_equivalent_to_with_ctx(context, one.crs.get(), other.crs.get(),
                                              PJ_COMP_EQUIVALENT) == 1;
      });
  entry->second = static_cast<std::size_t>(same - impl_->known.begin());
  if (same == impl_->known.end()) impl_->known.push_back(std::move(one));
  return entry->second;
}

}  // namespace qmpipe
