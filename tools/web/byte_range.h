// Range requests (RFC 9110, section 14): a part of an answer's body, so that a download can go on
// where it broke off.
#pragma once

#include <string_view>

#include "tools/web/tile_service.h"

namespace qmpipe::web {

// `reply` as it answers a GET with these headers (empty: not sent): 206 with the part for one range
// that can be had, 416 for one that cannot, and the whole for everything else: other statuses than
// 200, several ranges, other units, what is malformed, and an If-Range that names another state.
HttpReply ranged_reply(HttpReply reply, std::string_view range, std::string_view if_range);

}  // namespace qmpipe::web
