#include "tools/web/http_connection.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "scheduler/check.h"
#include "tools/web/request_head.h"

namespace qmpipe::web {
namespace {

using namespace std::chrono_literals;

// From a head's first byte to its last.
constexpr auto kHeadTime = 5s;
constexpr auto kSendStart = 10s;
constexpr std::size_t kSlowestBytesASecond = 16 << 10;
// An answer on its way when the server is to end.
constexpr auto kSendAfterStop = 1s;
constexpr auto kLingerTime = 1s;
constexpr std::size_t kLingerBytes = std::size_t{4} << 20U;

}  // namespace

HttpConnection::~HttpConnection() { ::close(socket_); }

HttpConnection::Wait HttpConnection::await(short events, Clock::time_point deadline) const {
  for (;;) {
    if (stop_) return Wait::kStopped;
    const Clock::duration left = deadline - Clock::now();
    if (left <= 0s) return Wait::kLate;
    pollfd waited = {.fd = socket_, .events = events, .revents = 0};
    const auto slice = std::chrono::ceil<std::chrono::milliseconds>(
        std::min<Clock::duration>(left, kStopLookedAt));
    if (::poll(&waited, 1, static_cast<int>(slice.count())) > 0) return Wait::kReady;
  }
}

long HttpConnection::receive(char* to, std::size_t capacity, Clock::time_point deadline) const {
  for (;;) {
    if (await(POLLIN, deadline) != Wait::kReady) return -1;
    const long count = ::recv(socket_, to, capacity, 0);
    if (count >= 0 || (errno != EINTR && errno != EAGAIN && errno != EWOULDBLOCK)) return count;
  }
}

HttpConnection::Head HttpConnection::await_head(Clock::duration patience) {
  Clock::time_point deadline = Clock::now() + (unread_.empty() ? patience : kHeadTime);
  std::array<char, 4096> piece{};
  for (;;) {
    const std::size_t length = head_length(unread_);
    if (length > HeadLimits::kBytes) return Head::kTooLong;
    if (length > 0) return Head::kWhole;
    if (unread_.size() >= HeadLimits::kBytes) return Head::kTooLong;
    const long count = receive(piece.data(), piece.size(), deadline);
    if (count <= 0) return Head::kNone;
    if (unread_.empty()) deadline = Clock::now() + kHeadTime;
    unread_.append(piece.data(), static_cast<std::size_t>(count));
  }
}

std::string HttpConnection::take_head() {
  const std::size_t length = head_length(unread_);
  QMPIPE_CHECK(length > 0);
  std::string head = unread_.substr(0, length);
  unread_.erase(0, length);
  return head;
}

bool HttpConnection::send(std::string_view bytes) {
  Clock::time_point deadline =
      Clock::now() + kSendStart + std::chrono::seconds(bytes.size() / kSlowestBytesASecond);
  bool was_stopped = false;
  while (!bytes.empty()) {
    const long count = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(count));
      continue;
    }
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK) return false;
    if (stop_ && !std::exchange(was_stopped, true)) {
      deadline = std::min(deadline, Clock::now() + kSendAfterStop);
    }
    if (Clock::now() >= deadline) return false;
    pollfd waited = {.fd = socket_, .events = POLLOUT, .revents = 0};
    ::poll(&waited, 1, static_cast<int>(kStopLookedAt.count()));
  }
  return true;
}

void HttpConnection::linger() {
  ::shutdown(socket_, SHUT_WR);
  const Clock::time_point deadline = Clock::now() + kLingerTime;
  std::array<char, 16384> piece{};
  for (std::size_t dropped = 0; dropped < kLingerBytes;) {
    const long count = receive(piece.data(), piece.size(), deadline);
    if (count <= 0) return;
    dropped += static_cast<std::size_t>(count);
  }
}

}  // namespace qmpipe::web
