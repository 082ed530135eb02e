// A web server over plain HTTP for one machine or a trusted network.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>

#include "tools/web/tile_service.h"

namespace qmpipe::web {

struct ListenOptions {
  std::string host = "127.0.0.1";
  int port = 8080;   // 0: any free one
  int threads = 64;  // as many connections are served at a time; others wait
};

// Answers GET and HEAD through a handler that may be called from any thread, and one range of what it
// gives; OPTIONS, other methods, malformed requests and addresses that the handler does not know are
// answered here, with 4xx and an {"error"} where something is wrong. Every answer allows any origin.
// A request is a head (tools/web/request_head.h has its limits) that comes within seconds; bodies are not
// read.
class HttpServer {
 public:
  using Handler = std::function<std::optional<HttpReply>(const HttpRequest&)>;

  // Listens from now on. Throws IoError when the address cannot be had, as when another program has
  // the port.
  HttpServer(const ListenOptions& options, Handler handler);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  int port() const { return port_; }
  // Serves until `stop` is true, and ends within 2 s of it, whatever clients do.
  void run(const std::atomic<bool>& stop);

 private:
  Handler handler_;
  int threads_ = 1;
  int socket_ = -1;
  int port_ = 0;
};

}  // namespace qmpipe::web
