// SPDX-License-Identifier: Apache-2.0
// Messages inside one process, with the faults of a network.
#include "server/transport/memory_transport.h"

#include <algorithm>
#include <deque>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "core/base/check.h"
#include "core/base/random.h"
#include "server/base/mutex.h"

namespace loci {
namespace {

struct Parcel {
  TimePoint due;
  std::string envelope;
  std::string body;
  std::function<void()> on_released;
};

struct Connection {
  bool open = true;
  bool told = false;  // the sink knows that it is closed
  bool woken = false;
  std::deque<Parcel> to_server;
  std::deque<Parcel> to_client;
  std::deque<Parcel> inbox;
};

}  // namespace

struct MemoryPeer::State {
  State(const MemoryTransportOptions& the_options, const Clock& the_clock)
      : options(the_options), clock(the_clock), random(the_options.seed) {}

  const MemoryTransportOptions options;
  const Clock& clock;
  TransportCounters counters;
  Mutex mutex;
  ConditionVariable server_changed;
  ConditionVariable client_changed;
  RandomSequence random LOCI_GUARDED_BY(mutex);
  std::map<std::uint64_t, Connection> connections LOCI_GUARDED_BY(mutex);
  std::uint64_t last_number LOCI_GUARDED_BY(mutex) = 0;
  bool stopped LOCI_GUARDED_BY(mutex) = false;
  bool changed LOCI_GUARDED_BY(mutex) = false;

  // Puts a message on its way, with the network's faults. False: it was lost.
  bool Post(std::deque<Parcel>& way, Parcel parcel) LOCI_REQUIRES(mutex) {
    if (random.NextUnit() < options.lose_probability) {
      return false;
    }
    parcel.due = clock.Now();
    if (options.delay_max.count() > 0) {
      const double delay_us =
          random.NextUniform(0.0, static_cast<double>(options.delay_max.count()));
      parcel.due += std::chrono::microseconds(static_cast<std::int64_t>(delay_us));
    }
    if (!way.empty()) {
      parcel.due = std::max(parcel.due, way.back().due);
    }
    Parcel repeat{parcel.due, {}, {}, {}};
    const bool repeated = random.NextUnit() < options.repeat_probability;
    if (repeated) {
      repeat.envelope = parcel.envelope;
      repeat.body = parcel.body;
    }
    way.push_back(std::move(parcel));
    if (repeated) {
      way.push_back(std::move(repeat));
    }
    return true;
  }

  void NotifyServer() LOCI_REQUIRES(mutex) {
    changed = true;
    server_changed.NotifyAll();
  }
};

namespace {

PeerId NameOf(std::uint64_t number) {
  return std::to_string(number);
}

void Release(std::vector<std::function<void()>>& released) {
  for (const std::function<void()>& callback : released) {
    if (callback) {
      callback();
    }
  }
  released.clear();
}

void Empty(std::deque<Parcel>& way, std::vector<std::function<void()>>& released) {
  for (Parcel& parcel : way) {
    released.push_back(std::move(parcel.on_released));
  }
  way.clear();
}

}  // namespace

MemoryPeer::MemoryPeer(std::shared_ptr<State> state, std::uint64_t number)
    : state_(std::move(state)), number_(number) {}

MemoryPeer::~MemoryPeer() {
  Close();
}

bool MemoryPeer::Send(std::string envelope, std::string body) {
  const MutexLock lock(state_->mutex);
  const auto found = state_->connections.find(number_);
  if (found == state_->connections.end() || !found->second.open) {
    return false;
  }
  state_->Post(found->second.to_server, {{}, std::move(envelope), std::move(body), {}});
  state_->NotifyServer();
  return true;
}

MemoryPeer::Received MemoryPeer::Receive(std::string& envelope,
                                         std::string& body,
                                         TimePoint until) {
  const MutexLock lock(state_->mutex);
  bool in_time = true;
  while (true) {
    const auto found = state_->connections.find(number_);
    if (found == state_->connections.end() || !found->second.open) {
      return Received::kClosed;
    }
    Connection& connection = found->second;
    if (!connection.inbox.empty()) {
      envelope = std::move(connection.inbox.front().envelope);
      body = std::move(connection.inbox.front().body);
      connection.inbox.pop_front();
      state_->NotifyServer();  // there is room again
      return Received::kMessage;
    }
    if (state_->stopped) {
      connection.open = false;
      return Received::kClosed;
    }
    if (connection.woken || !in_time) {
      connection.woken = false;
      return Received::kNothing;
    }
    in_time = state_->client_changed.WaitUntil(state_->mutex, until);
  }
}

void MemoryPeer::Wake() {
  const MutexLock lock(state_->mutex);
  const auto found = state_->connections.find(number_);
  if (found != state_->connections.end()) {
    found->second.woken = true;
    state_->client_changed.NotifyAll();
  }
}

void MemoryPeer::Close() {
  const MutexLock lock(state_->mutex);
  const auto found = state_->connections.find(number_);
  if (found != state_->connections.end() && found->second.open) {
    found->second.open = false;
    state_->counters.connections--;
    state_->client_changed.NotifyAll();
    state_->NotifyServer();
  }
}

MemoryTransport::MemoryTransport(const MemoryTransportOptions& options, const Clock& clock)
    : state_(std::make_shared<MemoryPeer::State>(options, clock)) {}

MemoryTransport::~MemoryTransport() {
  MemoryTransport::Stop(Duration::zero());
}

std::unique_ptr<MemoryPeer> MemoryTransport::Connect() {
  const MutexLock lock(state_->mutex);
  if (state_->stopped) {
    return nullptr;
  }
  const std::uint64_t number = ++state_->last_number;
  state_->connections.try_emplace(number);
  state_->counters.connections++;
  return std::unique_ptr<MemoryPeer>(new MemoryPeer(state_, number));
}

Status MemoryTransport::Start(TransportSink& sink) {
  sink_ = &sink;
  if (!state_->options.stepped) {
    thread_ = std::thread([this] { Run(); });
  }
  return {};
}

bool MemoryTransport::Send(OutgoingMessage message) {
  const MutexLock lock(state_->mutex);
  if (state_->stopped) {
    return false;
  }
  const std::size_t size = message.envelope.size() + message.body.size();
  state_->counters.messages_out++;
  state_->counters.bytes_out += size;
  Parcel parcel{{}, std::move(message.envelope), std::move(message.body), message.on_released};
  const auto found = state_->connections.find(std::stoull(message.peer));
  if (found == state_->connections.end() || !found->second.open ||
      !state_->Post(found->second.to_client, std::move(parcel))) {
    // Lost, or its reader is: it takes a way to nowhere, since `on_released` may not run in here.
    state_->counters.messages_undeliverable++;
    if (message.on_released) {
      state_->connections[0].open = false;
      state_->connections[0].told = true;
      state_->connections[0].to_client.push_back({{}, {}, {}, std::move(message.on_released)});
    }
  }
  state_->NotifyServer();
  return true;
}

void MemoryTransport::Wake() {
  const MutexLock lock(state_->mutex);
  state_->NotifyServer();
}

TimePoint MemoryTransport::Step() {
  struct Delivery {
    PeerId peer;
    Parcel parcel;
  };
  LOCI_CHECK(sink_ != nullptr);
  std::vector<Delivery> deliveries;
  std::vector<PeerId> gone;
  std::vector<std::function<void()>> released;
  TimePoint next = TimePoint::max();
  const TimePoint now = state_->clock.Now();
  {
    const MutexLock lock(state_->mutex);
    state_->changed = false;
    for (auto it = state_->connections.begin(); it != state_->connections.end();) {
      Connection& connection = it->second;
      if (!connection.open) {
        Empty(connection.to_client, released);
        if (!connection.told) {
          gone.push_back(NameOf(it->first));
        }
        it = state_->connections.erase(it);
        continue;
      }
      while (!connection.to_server.empty() && connection.to_server.front().due <= now) {
        deliveries.push_back({NameOf(it->first), std::move(connection.to_server.front())});
        connection.to_server.pop_front();
      }
      while (!connection.to_client.empty() && connection.to_client.front().due <= now &&
             connection.inbox.size() < state_->options.inbox_max) {
        released.push_back(std::move(connection.to_client.front().on_released));
        connection.inbox.push_back(std::move(connection.to_client.front()));
        connection.to_client.pop_front();
      }
      if (!connection.to_server.empty()) {
        next = std::min(next, connection.to_server.front().due);
      }
      if (!connection.to_client.empty() && connection.to_client.front().due > now) {
        next = std::min(next, connection.to_client.front().due);
      }
      ++it;
    }
    state_->client_changed.NotifyAll();
  }
  Release(released);
  for (Delivery& delivery : deliveries) {
    state_->counters.messages_in++;
    state_->counters.bytes_in += delivery.parcel.envelope.size() + delivery.parcel.body.size();
    sink_->OnMessage(
        delivery.peer, std::move(delivery.parcel.envelope), std::move(delivery.parcel.body));
  }
  for (const PeerId& peer : gone) {
    sink_->OnPeerGone(peer);
  }
  return std::min(next, sink_->OnTick(now));
}

void MemoryTransport::Run() {
  while (true) {
    const TimePoint next = Step();
    const MutexLock lock(state_->mutex);
    // Far enough for a wait, near enough not to overflow in it.
    const TimePoint until = std::min(next, state_->clock.Now() + std::chrono::hours(1));
    bool in_time = true;
    while (!state_->changed && !state_->stopped && in_time) {
      in_time = state_->server_changed.WaitUntil(state_->mutex, until);
    }
    if (state_->stopped) {
      return;
    }
  }
}

void MemoryTransport::Stop(Duration drain) {
  {
    const MutexLock lock(state_->mutex);
    const TimePoint until = std::chrono::steady_clock::now() + drain;
    const auto on_the_way = [this]() LOCI_REQUIRES(state_->mutex) {
      return std::any_of(state_->connections.begin(),
                         state_->connections.end(),
                         [](const auto& entry) { return !entry.second.to_client.empty(); });
    };
    while (thread_.joinable() && on_the_way() &&
           state_->client_changed.WaitUntil(state_->mutex, until)) {
    }
    state_->stopped = true;
    state_->server_changed.NotifyAll();
  }
  if (thread_.joinable()) {
    thread_.join();
  }
  std::vector<std::function<void()>> released;
  {
    const MutexLock lock(state_->mutex);
    for (auto& [number, connection] : state_->connections) {
      Empty(connection.to_client, released);
    }
    state_->client_changed.NotifyAll();
  }
  Release(released);
}

const TransportCounters& MemoryTransport::counters() const {
  return state_->counters;
}

}  // namespace loci
