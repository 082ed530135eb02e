#include "tools/http_server.h"

#include <fmt/format.h>
#include <httplib.h>

#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "formats/errors.h"

namespace qmpipe {
namespace {

// An idle connection holds a thread.
constexpr int kKeepAlive_s = 2;
constexpr std::size_t kRequestsOfAConnection = 100000;
constexpr auto kStopLookedAt = std::chrono::milliseconds(50);

void write_reply(const HttpReply& reply, httplib::Response& response) {
  response.status = reply.status;
  for (const auto& [name, value] : reply.headers) response.set_header(name, value);
  if (reply.status != 304) response.set_content(reply.body, reply.media_type);
}

HttpRequest request_of(const httplib::Request& request) {
  return {.path = request.path,
          .version = request.has_param("v") ? request.get_param_value("v") : "",
          .if_none_match = request.get_header_value("If-None-Match"),
          .accept_encoding = request.get_header_value("Accept-Encoding")};
}

HttpReply reply_to(const httplib::Request& request, const HttpServer::Handler& handler) {
  constexpr const char* kMethods = "GET, HEAD, OPTIONS";
  if (request.method == "OPTIONS") {
    return {.status = 204,
            .media_type = "text/plain",
            .body = {},
            .headers = {{"Allow", kMethods},
                        {"Access-Control-Allow-Methods", kMethods},
                        {"Access-Control-Allow-Headers", "*"},
                        {"Access-Control-Max-Age", "86400"}}};
  }
  if (request.method != "GET" && request.method != "HEAD") {
    HttpReply reply = error_reply(405, "only GET, HEAD and OPTIONS are answered");
    reply.headers.emplace_back("Allow", kMethods);
    return reply;
  }
  std::optional<HttpReply> reply = handler(request_of(request));
  if (reply) return std::move(*reply);
  return error_reply(404, fmt::format("there is nothing at {}", request.path));
}

const char* meaning_of(int status) {
  switch (status) {
    case 413:
      return "the request's body is too large";
    case 414:
      return "the address is too long";
    case 416:
      return "the range cannot be had";
    default:
      return status < 500 ? "the request is malformed" : "the server failed";
  }
}

std::string words_for(std::exception_ptr error) {
  try {
    std::rethrow_exception(std::move(error));
  } catch (const std::exception& exception) {
    return exception.what();
  } catch (...) {
    return meaning_of(500);
  }
}

}  // namespace

struct HttpServer::Impl {
  httplib::Server server;
};

HttpServer::HttpServer(const ListenOptions& options, Handler handler)
    : impl_(std::make_unique<Impl>()), port_(options.port) {
  httplib::Server& server = impl_->server;
  const auto threads = static_cast<std::size_t>(options.threads);
  server.new_task_queue = [threads] { return new httplib::ThreadPool(threads); };
  server.set_keep_alive_max_count(kRequestsOfAConnection);
  server.set_keep_alive_timeout(kKeepAlive_s);
  server.set_tcp_nodelay(true);
  server.set_payload_max_length(0);
  // The library's own would let a second server listen on the same port, unnoticed.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  });
  server.set_default_headers({{"Access-Control-Allow-Origin", "*"},
                              {"Access-Control-Expose-Headers", "ETag, Content-Encoding"},
                              {"X-Content-Type-Options", "nosniff"}});
  server.set_pre_routing_handler(
      [handler = std::move(handler)](const httplib::Request& request, httplib::Response& response) {
        write_reply(reply_to(request, handler), response);
        return httplib::Server::HandlerResponse::Handled;
      });
  server.set_error_handler([](const httplib::Request& /*request*/, httplib::Response& response) {
    if (response.body.empty()) {
      write_reply(error_reply(response.status, meaning_of(response.status)), response);
    }
  });
  server.set_exception_handler([](const httplib::Request& /*request*/, httplib::Response& response,
                                  std::exception_ptr error) {
    write_reply(error_reply(500, words_for(std::move(error))), response);
  });
  errno = 0;
  if (options.port == 0) {
    port_ = server.bind_to_any_port(options.host);
  } else if (!server.bind_to_port(options.host, options.port)) {
    port_ = -1;
  }
  if (port_ < 0) {
    throw IoError("cannot listen on", fmt::format("{}:{}", options.host, options.port),
                  errno != 0 ? std::strerror(errno) : "no such address",
                  "Choose another port with --port, or --port 0 for any free one.");
  }
}

HttpServer::~HttpServer() = default;

void HttpServer::run(const std::atomic<bool>& stop) {
  std::atomic<bool> is_over = false;
  std::thread watcher([&] {
    while (!stop && !is_over) std::this_thread::sleep_for(kStopLookedAt);
    // Before it listens it cannot be stopped.
    while (!impl_->server.is_running() && !is_over) std::this_thread::sleep_for(kStopLookedAt);
    impl_->server.stop();
  });
  impl_->server.listen_after_bind();
  is_over = true;
  watcher.join();
}

}  // namespace qmpipe
