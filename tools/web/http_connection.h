// One client's connection: requests in, answers out, none of it for longer than is fair to the others.
// What a client may send before it is answered is bounded in bytes and in time, how slowly it may read
// is too, and nothing waits for it once the server is to end.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

namespace qmpipe::web {

// How long a wait goes on before it looks whether the server is to end.
inline constexpr std::chrono::milliseconds kStopLookedAt{50};

class HttpConnection {
 public:
  using Clock = std::chrono::steady_clock;
  enum class Head { kWhole, kTooLong, kNone };

  // Owns `socket`, which does not block. `stop` outlives this.
  HttpConnection(int socket, const std::atomic<bool>& stop) : socket_(socket), stop_(stop) {}
  ~HttpConnection();
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  // Waits for the next request's head, which take_head() then gives. kNone: none came in time, the
  // client is gone, or the server is to end.
  Head await_head(Clock::duration patience);
  std::string take_head();

  // False where the client does not take it in time; then nothing more can be sent.
  bool send(std::string_view bytes);

  // After the last answer: what the client is still sending is read for a moment and dropped, for a
  // connection that is closed on unread bytes is reset, and the answer is lost on its way.
  void linger();

 private:
  enum class Wait { kReady, kLate, kStopped };
  Wait await(short events, Clock::time_point deadline) const;
  // As recv(): 0 at the end. Negative: failed, late or stopped.
  long receive(char* to, std::size_t capacity, Clock::time_point deadline) const;

  int socket_;
  const std::atomic<bool>& stop_;
  std::string unread_;  // a head, once await_head() found one, and what came with it
};

}  // namespace qmpipe::web
