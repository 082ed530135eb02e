// What any answer of a tile server shows before its contents are looked at: status, CORS, encoding,
// whether it is whole, whether it is a web page.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/web_check/check_finding.h"
#include "pipeline/web_check/http_answer.h"
#include "pipeline/web_check/web_address.h"

namespace qmpipe::web_check {

// The page that asks. Where the user named it, what it may not load is a fault and not a warning.
struct AskingPage {
  std::string origin;
  bool is_stated = false;
};

// Whether the browser would hand this answer to the page.
void check_cors(const AskingPage& page, const WebAddress& asked, const HttpAnswer& answer,
                CheckSubject subject, CheckLog& log);

// The body as a viewer would have to see it: with the Content-Encoding undone, and with gzip undone
// that was not announced (which is a finding), so that the contents can be looked at in any case.
// None when it cannot be had; then there is a finding.
std::optional<std::vector<std::uint8_t>> plain_body(const HttpAnswer& answer, CheckSubject subject,
                                                    CheckLog& log);

// Begins like HTML, whatever its Content-Type says.
bool is_html(std::span<const std::uint8_t> body);

// "the server answers 404".
std::string status_text(const HttpAnswer& answer);

}  // namespace qmpipe::web_check
