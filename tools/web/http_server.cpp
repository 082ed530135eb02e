#include "tools/web/http_server.h"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <memory>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "formats/bytes/errors.h"
#include "tools/web/byte_range.h"
#include "tools/web/http_connection.h"
#include "tools/web/request_head.h"

namespace qmpipe::web {
namespace {

using namespace std::chrono_literals;

constexpr int kBacklog = 512;
constexpr auto kFirstRequest = 5s;
// An idle connection holds a thread.
constexpr auto kNextRequest = 2s;
constexpr int kRequestsOfAConnection = 100000;
constexpr const char* kMethodsAnswered = "GET, HEAD, OPTIONS";

const char* words_of(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 204:
      return "No Content";
    case 206:
      return "Partial Content";
    case 304:
      return "Not Modified";
    case 400:
      return "Bad Request";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 414:
      return "URI Too Long";
    case 416:
      return "Range Not Satisfiable";
    case 431:
      return "Request Header Fields Too Large";
    default:
      return status < 500 ? "Client Error" : "Internal Server Error";
  }
}

// RFC 9110, section 5.6.7: in English whatever the locale.
std::string date_now() {
  constexpr std::array<const char*, 7> kDays = {"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  constexpr std::array<const char*, 12> kMonths = {"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                                   "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  const time_t now = ::time(nullptr);
  tm utc{};
  ::gmtime_r(&now, &utc);
  return fmt::format("{}, {:02} {} {} {:02}:{:02}:{:02} GMT",
                     kDays.at(static_cast<std::size_t>(utc.tm_wday)), utc.tm_mday,
                     kMonths.at(static_cast<std::size_t>(utc.tm_mon)), 1900 + utc.tm_year,
                     utc.tm_hour, utc.tm_min, utc.tm_sec);
}

enum class Body { kSent, kLeftOut };
enum class After { kKeepAlive, kClose };

std::string bytes_of(const HttpReply& reply, Body body, After after) {
  std::string text = fmt::format("HTTP/1.1 {} {}\r\nDate: {}\r\n", reply.status,
                                 words_of(reply.status), date_now());
  text +=
      "Access-Control-Allow-Origin: *\r\n"
      "Access-Control-Expose-Headers: Accept-Ranges, Content-Encoding, Content-Range, ETag\r\n"
      "X-Content-Type-Options: nosniff\r\n";
  for (const auto& [name, value] : reply.headers) text += fmt::format("{}: {}\r\n", name, value);
  if (reply.status != 204 && reply.status != 304) {
    text += fmt::format("Content-Type: {}\r\nContent-Length: {}\r\n", reply.media_type,
                        reply.body.size());
  }
  text += after == After::kClose ? "Connection: close\r\n\r\n" : "Connection: keep-alive\r\n\r\n";
  if (body == Body::kSent) text += reply.body;
  return text;
}

HttpReply options_reply() {
  // "*" stands for every header but Authorization, which is to be named (Fetch standard).
  return {.status = 204,
          .media_type = {},
          .body = {},
          .headers = {{"Allow", kMethodsAnswered},
                      {"Access-Control-Allow-Methods", kMethodsAnswered},
                      {"Access-Control-Allow-Headers", "*, Authorization"},
                      {"Access-Control-Max-Age", "86400"}}};
}

HttpReply reply_to(const RequestHead& head, const HttpServer::Handler& handler) {
  if (head.method == "OPTIONS") return options_reply();
  if (head.method != "GET" && head.method != "HEAD") {
    HttpReply reply = error_reply(405, "only GET, HEAD and OPTIONS are answered");
    reply.headers.emplace_back("Allow", kMethodsAnswered);
    return reply;
  }
  try {
    std::optional<HttpReply> reply = handler({.path = head.path,
                                              .version = head.version,
                                              .if_none_match = head.header("if-none-match"),
                                              .accept_encoding = head.header("accept-encoding")});
    if (!reply) return error_reply(404, fmt::format("there is nothing at {}", head.path));
    if (head.method == "HEAD") return ranged_reply(*std::move(reply), "", "");
    return ranged_reply(*std::move(reply), head.header("range"), head.header("if-range"));
  } catch (const std::exception& error) {
    return error_reply(500, error.what());
  }
}

// False when it was the last on this connection.
bool answer_next(HttpConnection& connection, HttpConnection::Clock::duration patience, After after,
                 const HttpServer::Handler& handler) {
  const HttpConnection::Head found = connection.await_head(patience);
  if (found == HttpConnection::Head::kNone) return false;
  HttpReply reply;
  Body body = Body::kSent;
  if (found == HttpConnection::Head::kTooLong) {
    reply = error_reply(431, fmt::format("the request has more than {} bytes", HeadLimits::kBytes));
    after = After::kClose;
  } else {
    const auto parsed = parse_request_head(connection.take_head());
    if (const auto* fault = std::get_if<HeadFault>(&parsed)) {
      reply = error_reply(fault->status, fault->message);
      after = After::kClose;
    } else {
      const RequestHead& head = *std::get_if<RequestHead>(&parsed);
      reply = reply_to(head, handler);
      if (head.method == "HEAD") body = Body::kLeftOut;
      // A body is not read, and must not be taken for the next request.
      if (head.has_body || !head.keeps_alive || head.method == "CONNECT") after = After::kClose;
    }
  }
  if (!connection.send(bytes_of(reply, body, after))) return false;
  if (after == After::kClose) connection.linger();
  return after == After::kKeepAlive;
}

void serve_connection(HttpConnection& connection, const HttpServer::Handler& handler) {
  for (int k = 1; k <= kRequestsOfAConnection; ++k) {
    const After after = k < kRequestsOfAConnection ? After::kKeepAlive : After::kClose;
    if (!answer_next(connection,
                     k == 1 ? HttpConnection::Clock::duration(kFirstRequest) : kNextRequest, after,
                     handler)) {
      return;
    }
  }
}

// The next connection; -1 when the server is to end.
int accept_next(int listening, const std::atomic<bool>& stop) {
  while (!stop) {
    pollfd waited = {.fd = listening, .events = POLLIN, .revents = 0};
    const int slice_ms = static_cast<int>(kStopLookedAt.count());
    if (::poll(&waited, 1, slice_ms) <= 0) continue;
    const int socket = ::accept4(listening, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (socket >= 0) {
      const int yes = 1;
      ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
      return socket;
    }
    // No descriptor is free until a connection ends; the client waits in the backlog.
    if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      std::this_thread::sleep_for(kStopLookedAt);
    }
  }
  return -1;
}

struct EndAtExit {
  std::atomic<bool>& is_over;
  ~EndAtExit() { is_over = true; }
};

struct FreeAddresses {
  void operator()(addrinfo* first) const { ::freeaddrinfo(first); }
};

// A listening socket, or -1 with why not in `errno` (0: the address is unknown).
int listen_at(const std::string& host, int port) {
  const addrinfo hints = {.ai_flags = AI_PASSIVE | AI_NUMERICSERV,
                          .ai_family = AF_UNSPEC,
                          .ai_socktype = SOCK_STREAM,
                          .ai_protocol = 0,
                          .ai_addrlen = 0,
                          .ai_addr = nullptr,
                          .ai_canonname = nullptr,
                          .ai_next = nullptr};
  addrinfo* found = nullptr;
  errno = 0;
  if (::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) {
    errno = 0;
    return -1;
  }
  const std::unique_ptr<addrinfo, FreeAddresses> addresses(found);
  int why = 0;
  for (const addrinfo* at = addresses.get(); at != nullptr; at = at->ai_next) {
    const int socket = ::socket(at->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    const int yes = 1;
    // After a restart, not beside another server: that would take SO_REUSEPORT.
    if (socket >= 0 && ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes)) == 0 &&
        ::bind(socket, at->ai_addr, at->ai_addrlen) == 0 && ::listen(socket, kBacklog) == 0) {
      return socket;
    }
    why = errno;
    if (socket >= 0) ::close(socket);
  }
  errno = why;
  return -1;
}

int port_of(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  if (address.ss_family == AF_INET6) {
    return ntohs(reinterpret_cast<const sockaddr_in6*>(&address)->sin6_port);
  }
  return ntohs(reinterpret_cast<const sockaddr_in*>(&address)->sin_port);
}

}  // namespace

HttpServer::HttpServer(const ListenOptions& options, Handler handler)
    : handler_(std::move(handler)),
      threads_(options.threads),
      socket_(listen_at(options.host, options.port)) {
  if (socket_ < 0) {
    throw IoError("cannot listen on", fmt::format("{}:{}", options.host, options.port),
                  errno != 0 ? std::strerror(errno) : "no such address",
                  "Choose another port with --port, or --port 0 for any free one.");
  }
  port_ = port_of(socket_);
}

HttpServer::~HttpServer() {
  if (socket_ >= 0) ::close(socket_);
}

void HttpServer::run(const std::atomic<bool>& stop) {
  std::atomic<bool> is_over = false;
  // One thread at a time waits for the next client; who got one makes room for another.
  std::mutex is_accepting;
  const auto work = [&] {
    for (;;) {
      int socket = -1;
      {
        const std::scoped_lock lock(is_accepting);
        socket = accept_next(socket_, is_over);
      }
      if (socket < 0) return;
      HttpConnection connection(socket, is_over);
      serve_connection(connection, handler_);
    }
  };
  std::vector<std::jthread> workers;
  // Before they are joined, also where one of them could not be started.
  const EndAtExit end{is_over};
  for (int k = 0; k < threads_; ++k) workers.emplace_back(work);
  while (!stop) std::this_thread::sleep_for(kStopLookedAt);
}

}  // namespace qmpipe::web
