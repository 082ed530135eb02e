#include "tools/web/http_client.h"

#include <curl/curl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <exception>
#include <new>
#include <string_view>

#include "formats/bytes/letter_case.h"
#include "pipeline/common/version.h"
#include "pipeline/run/progress.h"
#include "scheduler/check.h"

namespace qmpipe::web {
namespace {

constexpr long kMostRedirects = 5;
// Of all answers of one request, redirections included.
constexpr std::size_t kMostHeaderBytes = std::size_t{256} << 10U;

struct FreeList {
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
};
using HeaderList = std::unique_ptr<curl_slist, FreeList>;

// What libcurl hands over while an answer comes in.
struct Incoming {
  web_check::HttpAnswer answer;
  std::size_t limit_bytes = 0;
  std::size_t header_bytes = 0;
  bool is_too_large = false;
  bool has_too_many_headers = false;
  const std::atomic<bool>* stop = nullptr;
  // No exception may pass through libcurl.
  std::exception_ptr failure;
};

void take_header_line(std::string_view line, web_check::HttpAnswer& answer) {
  while (!line.empty() && (line.back() == '\n' || line.back() == '\r')) line.remove_suffix(1);
  // The status line of the next answer: after a redirection, or after "100 Continue".
  if (line.starts_with("HTTP/")) {
    answer.headers.clear();
    answer.body.clear();
    return;
  }
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos) return;
  std::string_view value = line.substr(colon + 1);
  while (!value.empty() && (value.front() == ' ' || value.front() == '\t')) value.remove_prefix(1);
  while (!value.empty() && (value.back() == ' ' || value.back() == '\t')) value.remove_suffix(1);
  answer.headers.push_back(
      {.name = lower_case(line.substr(0, colon)), .value = std::string(value)});
}

// A count other than `size` makes libcurl stop.
std::size_t on_header(const char* bytes, std::size_t, std::size_t size, void* user) {
  auto& incoming = *static_cast<Incoming*>(user);
  incoming.header_bytes += size;
  incoming.has_too_many_headers = incoming.header_bytes > kMostHeaderBytes;
  if (incoming.has_too_many_headers) return 0;
  try {
    take_header_line({bytes, size}, incoming.answer);
  } catch (...) {
    incoming.failure = std::current_exception();
    return 0;
  }
  return size;
}

std::size_t on_body(const char* bytes, std::size_t, std::size_t size, void* user) {
  auto& incoming = *static_cast<Incoming*>(user);
  std::vector<std::uint8_t>& body = incoming.answer.body;
  incoming.is_too_large = size > incoming.limit_bytes - body.size();
  if (incoming.is_too_large) return 0;
  try {
    body.insert(body.end(), bytes, bytes + size);
  } catch (...) {
    incoming.failure = std::current_exception();
    return 0;
  }
  return size;
}

int on_progress(void* user, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  const auto& incoming = *static_cast<const Incoming*>(user);
  return incoming.stop != nullptr && incoming.stop->load(std::memory_order_relaxed) ? 1 : 0;
}

HeaderList list_of(const std::vector<web_check::HttpHeader>& headers) {
  HeaderList list;
  for (const web_check::HttpHeader& header : headers) {
    curl_slist* longer = curl_slist_append(list.get(), (header.name + ": " + header.value).c_str());
    if (longer == nullptr) throw std::bad_alloc();
    // The list keeps its first element.
    if (!list) list.reset(longer);
  }
  return list;
}

std::string words_for(CURLcode code, const std::string& detail, double timeout_s,
                      const Incoming& incoming) {
  std::string why = detail.empty() ? curl_easy_strerror(code) : detail;
  switch (code) {
    case CURLE_COULDNT_RESOLVE_HOST:
      return "the host's name cannot be resolved: " + why;
    case CURLE_COULDNT_CONNECT:
      return "cannot connect: " + why;
    case CURLE_OPERATION_TIMEDOUT:
      return fmt::format("no complete answer within {} seconds ({} bytes of the body came): {}",
                         timeout_s, incoming.answer.body.size(), why);
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CACERT_BADFILE:
      return "the server's certificate is not trusted: " + why;
    case CURLE_SSL_CONNECT_ERROR:
      return "no secure connection (https): " + why;
    case CURLE_TOO_MANY_REDIRECTS:
      return fmt::format("more than {} redirections, one after the other", kMostRedirects);
    case CURLE_UNSUPPORTED_PROTOCOL:
    case CURLE_WEIRD_SERVER_REPLY:
      return "what answers there does not speak HTTP: " + why;
    case CURLE_GOT_NOTHING:
      return "the server closed the connection without an answer";
    default:
      return why;
  }
}

}  // namespace

struct HttpClient::Impl {
  struct FreeHandle {
    void operator()(CURL* easy) const { curl_easy_cleanup(easy); }
  };
  std::unique_ptr<CURL, FreeHandle> handle;
  double timeout_s = 0;
  const std::atomic<bool>* stop = nullptr;
  std::array<char, CURL_ERROR_SIZE> detail{};

  template <class Value>
  void set(CURLoption option, Value value) {
    // An option that this libcurl does not know would silently change what is asked.
    QMPIPE_CHECK(curl_easy_setopt(handle.get(), option, value) == CURLE_OK);
  }

  void prepare(const web_check::HttpQuestion& request, const HeaderList& headers,
               Incoming& incoming) {
    curl_easy_reset(handle.get());  // keeps the connections
    const long timeout_ms = std::max(1L, std::lround(timeout_s * 1000));
    detail.fill('\0');
    set(CURLOPT_ERRORBUFFER, detail.data());
    set(CURLOPT_URL, request.url.c_str());
    set(CURLOPT_PROTOCOLS_STR, "http,https");
    set(CURLOPT_REDIR_PROTOCOLS_STR, "http,https");
    set(CURLOPT_USERAGENT, (std::string("qmpipe/") + kProgramVersion).c_str());
    set(CURLOPT_HTTPHEADER, headers.get());
    set(CURLOPT_NOBODY, request.method == web_check::HttpMethod::kHead ? 1L : 0L);
    set(CURLOPT_FOLLOWLOCATION, 1L);
    set(CURLOPT_MAXREDIRS, kMostRedirects);
    set(CURLOPT_TIMEOUT_MS, timeout_ms);
    set(CURLOPT_CONNECTTIMEOUT_MS, timeout_ms);
    set(CURLOPT_NOSIGNAL, 1L);
    set(CURLOPT_HEADERFUNCTION, &on_header);
    set(CURLOPT_HEADERDATA, &incoming);
    set(CURLOPT_WRITEFUNCTION, &on_body);
    set(CURLOPT_WRITEDATA, &incoming);
    set(CURLOPT_NOPROGRESS, 0L);
    set(CURLOPT_XFERINFOFUNCTION, &on_progress);
    set(CURLOPT_XFERINFODATA, &incoming);
  }

  void describe(web_check::HttpAnswer& answer) const {
    long status = 0;
    long redirects = 0;
    const char* url = nullptr;
    curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &status);
    curl_easy_getinfo(handle.get(), CURLINFO_REDIRECT_COUNT, &redirects);
    curl_easy_getinfo(handle.get(), CURLINFO_EFFECTIVE_URL, &url);
    answer.status = static_cast<int>(status);
    answer.redirects = static_cast<int>(redirects);
    if (url != nullptr) answer.url = url;
  }
};

HttpClient::HttpClient(double timeout_s, const std::atomic<bool>* stop)
    : impl_(std::make_unique<Impl>()) {
  QMPIPE_CHECK(timeout_s > 0);
  impl_->timeout_s = timeout_s;
  impl_->stop = stop;
  impl_->handle.reset(curl_easy_init());
  if (!impl_->handle) throw std::bad_alloc();
}
HttpClient::~HttpClient() = default;
HttpClient::HttpClient(HttpClient&&) noexcept = default;
HttpClient& HttpClient::operator=(HttpClient&&) noexcept = default;

Result<web_check::HttpAnswer> HttpClient::send(const web_check::HttpQuestion& request) {
  Incoming incoming;
  incoming.limit_bytes = request.limit_bytes;
  incoming.stop = impl_->stop;
  const HeaderList headers = list_of(request.headers);
  impl_->prepare(request, headers, incoming);
  const CURLcode code = curl_easy_perform(impl_->handle.get());
  if (incoming.failure) std::rethrow_exception(incoming.failure);
  if (code == CURLE_ABORTED_BY_CALLBACK) throw Interrupted("interrupted");
  if (incoming.is_too_large) {
    return Error{fmt::format("the answer is larger than {} bytes", request.limit_bytes)};
  }
  if (incoming.has_too_many_headers) {
    return Error{fmt::format("the answer has more than {} bytes of headers", kMostHeaderBytes)};
  }
  impl_->describe(incoming.answer);
  // The answer began well and then the connection broke.
  const bool is_broken = code == CURLE_PARTIAL_FILE || code == CURLE_RECV_ERROR;
  if (is_broken && incoming.answer.status != 0 && !incoming.answer.headers.empty()) {
    incoming.answer.is_cut_off = true;
  } else if (code != CURLE_OK) {
    return Error{words_for(code, impl_->detail.data(), impl_->timeout_s, incoming)};
  }
  return std::move(incoming.answer);
}

}  // namespace qmpipe::web
