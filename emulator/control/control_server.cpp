#include "emulator/control/control_server.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <utility>

#include "emulator/control/send_queue.hpp"
#include "emulator/ground/text_file.hpp"
#include "transports/port_spec.hpp"

namespace imud {

namespace asio = boost::asio;
using Socket = asio::generic::stream_protocol::socket;
using ErrorCode = boost::system::error_code;

// A connection. The object exists as long as an operation on the connection, or an answer, is pending.
class ControlServer::Client final : public Subscriber, public std::enable_shared_from_this<Client> {
 public:
  // `token`: the token that the client must show first; nullptr: none. The token must outlive this.
  Client(Socket socket, ControlApi& api, const Token* token)
      : socket_(std::move(socket)),
        api_(api),
        token_(token),
        deadline_(socket_.get_executor()),
        output_(api.counters()) {}

  void start() {
    if (token_ != nullptr) {
      deadline_.expires_after(std::chrono::seconds(10));
      deadline_.async_wait([weak = weak_from_this()](const ErrorCode& error) {
        const auto self = weak.lock();
        if (self == nullptr || error || self->token_ == nullptr) return;
        self->api_.counters().connections_refused.count();
        self->close();
      });
    }
    read();
  }

  void notify(const std::shared_ptr<const std::string>& text, Notification kind) override {
    if (!socket_.is_open()) return;
    output_.notify(text, kind);
    write();
  }

  // Sends the text and closes.
  void refuse(std::string text) {
    closes_ = true;
    answer(std::move(text));
  }

  void close() {
    ErrorCode ignored;
    socket_.close(ignored);
    deadline_.cancel();
  }

 private:
  static constexpr int most_calls = 32;  // with more unanswered calls, the client's requests are not read

  void read() {
    if (is_reading_ || has_ended_ || closes_ || calls_ >= most_calls || !socket_.is_open()) return;
    is_reading_ = true;
    socket_.async_read_some(asio::buffer(buffer_),
                            [self = shared_from_this()](const ErrorCode& error, std::size_t n) {
                              self->is_reading_ = false;
                              self->on_read(error, n);
                            });
  }

  void on_read(const ErrorCode& error, std::size_t size) {
    input_.append(buffer_.data(), size);
    if (error) {
      has_ended_ = true;
      if (!input_.empty()) input_ += '\n';  // the last line may lack its line feed
    }
    take_lines();
  }

  // If a client has many unanswered requests, its further requests wait.
  void take_lines() {
    if (std::exchange(is_taking_, true)) return;  // called by an answer that came at once
    std::size_t begin = 0;
    for (std::size_t end = 0; calls_ < most_calls && !closes_ && (end = input_.find('\n', begin)) != input_.npos;
         begin = end + 1) {
      std::string_view line(input_.data() + begin, end - begin);
      if (line.ends_with('\r')) line.remove_suffix(1);
      if (!line.empty()) take(line);
    }
    input_.erase(0, begin);
    // A line longer than max_request is refused without waiting for its end.
    if (input_.size() > ControlApi::max_request && input_.find('\n') == input_.npos)
      refuse(ControlApi::refuse_long());
    if (closes_) input_.clear();
    is_taking_ = false;
    close_if_done();
    read();
  }

  void take(std::string_view line) {
    if (token_ != nullptr) return authenticate(line);
    ++calls_;
    api_.call(
        line,
        [self = shared_from_this()](std::string answer) {  // while nothing is read, this keeps the client
          --self->calls_;
          if (!answer.empty()) self->answer(std::move(answer));
          self->take_lines();  // which may have waited for it
        },
        shared_from_this());
  }

  // Anything but the right token closes the connection, so that neither a browser nor a search for the token gets
  // further.
  void authenticate(std::string_view line) {
    bool is_good = false;
    answer_rpc(
        line,
        [&](const std::string& method, const Json& params, const RpcReply& reply) {
          RpcParams named(params);
          is_good = method == "authenticate" && token_->matches(named.text("token", "the token"));
          if (!is_good) throw RpcError(RpcError::refused, "the first request must be authenticate, with the token");
          reply.result({{"authenticated", true}});
        },
        [&](std::string answer) {
          closes_ = !is_good;
          if (!answer.empty()) this->answer(std::move(answer));
        });
    if (is_good)
      token_ = nullptr;
    else
      api_.counters().connections_refused.count();
  }

  void answer(std::string text) {
    if (!socket_.is_open()) return;
    if (!output_.add(std::make_shared<const std::string>(std::move(text)))) return close();
    write();
  }

  void write() {
    if (is_writing_ || output_.empty()) return;
    is_writing_ = true;
    static constexpr char line_feed = '\n';
    const std::array<asio::const_buffer, 2> buffers = {asio::buffer(output_.front()), asio::buffer(&line_feed, 1)};
    asio::async_write(socket_, buffers, [self = shared_from_this()](const ErrorCode& error, std::size_t) {
      self->is_writing_ = false;
      self->output_.pop();
      if (error) return self->close();
      self->write();
      self->close_if_done();
    });
  }

  void close_if_done() {
    if (output_.empty() && (closes_ || (has_ended_ && calls_ == 0 && input_.empty()))) close();
  }

  Socket socket_;
  ControlApi& api_;
  const Token* token_;  // nullptr: nothing is missing
  asio::steady_timer deadline_;
  std::array<char, 16 * 1024> buffer_;
  std::string input_;  // input from the beginning of a line
  SendQueue output_;
  int calls_ = 0;  // calls that are not answered yet
  bool is_reading_ = false, is_writing_ = false, is_taking_ = false;
  bool has_ended_ = false;  // the client sends nothing more
  bool closes_ = false;     // when all is written
};

namespace {

// Returns true if the process at the other end is of this user, or of root.
bool is_same_user(int descriptor) {
  ucred peer{};
  socklen_t size = sizeof peer;
  return ::getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 && may_control(peer.uid, ::geteuid());
}

}  // namespace

ControlServer::ControlServer(asio::io_context& io, const ControlConfig& config, const std::string& name)
    : io_(io), retry_local_(io), retry_tcp_(io) {
  if (config.socket == "auto") {
    try {
      socket_.emplace(ControlSocketFile::in_folder(name));
    } catch (const OpenError& error) {
      if (!config.name.empty()) throw;  // a client will look for that name
      spdlog::info("no socket for imud ctl: {}", error.what());
    }
  } else if (config.socket != "none") {
    socket_.emplace(config.socket);
  }
  if (socket_) {
    spdlog::debug("imud ctl finds this run as {}, at {}", name, socket_->path());
    local_.emplace(io_, asio::local::stream_protocol(), socket_->release());
  }
  if (config.listen.empty()) return;
  token_ = Token::read(config.token_file);
  const NumericAddress address = NumericAddress::parse(config.listen);
  const asio::ip::tcp::endpoint endpoint(asio::ip::make_address(address.address), address.port);
  try {
    tcp_.emplace(io_, endpoint);
  } catch (const boost::system::system_error& error) {
    throw OpenError(fmt::format("control.listen {}: {}", config.listen, error.code().message()));
  }
  spdlog::info("control: TCP port {}", tcp_->local_endpoint().port());
}

void ControlServer::start(ControlApi& api) {
  api_ = &api;
  if (local_) accept_local();
  if (tcp_) accept_tcp();
}

ControlServer::~ControlServer() {
  for (const auto& weak : clients_)
    if (const auto client = weak.lock()) client->close();
}

std::optional<std::uint16_t> ControlServer::port() const {
  return tcp_ ? std::optional(tcp_->local_endpoint().port()) : std::nullopt;
}

std::size_t ControlServer::clients() const noexcept {
  return static_cast<std::size_t>(
      std::count_if(clients_.begin(), clients_.end(), [](const auto& client) { return !client.expired(); }));
}

void ControlServer::accept_local() {
  local_->async_accept([this](const ErrorCode& error, asio::local::stream_protocol::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (error) return accept_later(error, &ControlServer::accept_local, retry_local_);
    add(std::move(socket), false);
    accept_local();
  });
}

void ControlServer::accept_tcp() {
  tcp_->async_accept([this](const ErrorCode& error, asio::ip::tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (error) return accept_later(error, &ControlServer::accept_tcp, retry_tcp_);
    ErrorCode ignored;
    socket.set_option(asio::ip::tcp::no_delay(true), ignored);
    add(std::move(socket), true);
    accept_tcp();
  });
}

// With too many open files, for example, the connection keeps waiting, and accepting it would fail again at once.
void ControlServer::accept_later(const ErrorCode& error, void (ControlServer::*accept)(), asio::steady_timer& retry) {
  if (!std::exchange(refusal_reported_, true))
    spdlog::warn("control: a connection cannot be accepted: {}; tried again every 100 ms (reported once)",
                 error.message());
  retry.expires_after(std::chrono::milliseconds(100));
  retry.async_wait([this, accept](const ErrorCode& aborted) {
    if (!aborted) (this->*accept)();
  });
}

void ControlServer::add(Socket socket, bool needs_token) {
  std::erase_if(clients_, [](const auto& client) { return client.expired(); });
  const bool is_admitted = needs_token || is_same_user(socket.native_handle());
  const auto client = std::make_shared<Client>(std::move(socket), *api_, needs_token ? &*token_ : nullptr);
  const bool is_full = clients_.size() >= most_clients;
  if (!is_admitted || is_full) api_->counters().connections_refused.count();
  if (!is_admitted)
    return client->refuse(rpc_refusal(RpcError(RpcError::refused, "this imud belongs to another user")));
  if (is_full)
    return client->refuse(rpc_refusal(RpcError(RpcError::busy, fmt::format("there are {} clients", most_clients))));
  clients_.push_back(client);
  client->start();
}

}  // namespace imud
