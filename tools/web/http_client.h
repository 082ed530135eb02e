// Asks web servers, through libcurl: http and https (with the system's certificates), redirections
// followed, proxies as the environment names them (https_proxy, no_proxy).
//
// Guarantees: whatever a server sends, a call ends within the timeout with an answer or with an
// error in words, and holds no more than the request's limit of bytes and some hundred kB of headers.
// Bodies stay as they were sent. Connections are kept open between calls.
//
// Not cpp-httplib's client: its regular expression for the status line overflows the stack on a long
// one, and it limits neither the time of a whole answer nor the number of its headers.
// One object is used by one thread.
#pragma once

#include <atomic>
#include <memory>

#include "formats/bytes/result.h"
#include "pipeline/web_check/http_answer.h"

namespace qmpipe::web {

class HttpClient {
 public:
  // timeout_s: for one whole answer. `stop`: where it becomes true, send() throws Interrupted; may
  // be null.
  HttpClient(double timeout_s, const std::atomic<bool>* stop);
  ~HttpClient();
  HttpClient(HttpClient&&) noexcept;
  HttpClient& operator=(HttpClient&&) noexcept;

  Result<web_check::HttpAnswer> send(const web_check::HttpQuestion& request);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace qmpipe::web
