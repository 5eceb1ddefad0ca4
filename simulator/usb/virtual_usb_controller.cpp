#include "simulator/usb/virtual_usb_controller.h"

#include <algorithm>
#include <utility>

namespace scatter::simulator {
namespace {

using firmware::UsbEndpoint;
using firmware::UsbEvent;

constexpr std::uint8_t kToHost = 0x80;
constexpr std::uint8_t kEndpointNumber = 0x0F;

bool is_in(std::uint8_t endpoint) noexcept {
  return (endpoint & kToHost) != 0;
}

bool same(const UsbEndpoint& a, const UsbEndpoint& b) noexcept {
  return a.address == b.address && a.type == b.type && a.packet_bytes == b.packet_bytes;
}

template <typename Pipe>
Pipe* find(std::list<Pipe>& pipes, std::uint8_t address) noexcept {
  const auto found =
      std::ranges::find_if(pipes, [address](const Pipe& pipe) { return pipe.endpoint().address == address; });
  return found == pipes.end() ? nullptr : &*found;
}

/// Those named stay or come, emptied; the others go, and their transfers with them.
template <typename Pipe, typename Make>
void open_pipes(std::list<Pipe>& pipes, std::span<const UsbEndpoint> endpoints, bool in, const Make& make) {
  std::erase_if(pipes, [&](Pipe& pipe) {
    const bool named = std::ranges::any_of(
        endpoints, [&](const UsbEndpoint& endpoint) { return same(endpoint, pipe.endpoint()); });
    if (named) {
      pipe.forget();
    } else {
      pipe.end_all(UsbOutcome::kError);
    }
    return !named;
  });
  for (const UsbEndpoint& endpoint : endpoints) {
    if (is_in(endpoint.address) == in && find(pipes, endpoint.address) == nullptr) {
      make(endpoint);
    }
  }
}

}  // namespace

VirtualUsbController::VirtualUsbController(firmware::Clock& since_power_on, const FaultPlan& plan,
                                           std::uint64_t seed)
    : clock_(since_power_on),
      to_host_(plan, seed, Direction::kToHost),
      to_device_(plan, seed, Direction::kToDevice),
      transfers_(plan.usb, seed) {}

void VirtualUsbController::clear_bus() {
  control_.end_all(UsbOutcome::kGone);
  for (InPipe& pipe : ins_) {
    pipe.end_all(UsbOutcome::kGone);
  }
  for (OutPipe& pipe : outs_) {
    pipe.end_all(UsbOutcome::kGone);
  }
  ins_.clear();
  outs_.clear();
  to_host_.clear();
  to_device_.clear();
  events_.clear();
  address_ = 0;
}

void VirtualUsbController::appear() {
  ++joins_;
  events_.push_back({.kind = UsbEvent::Kind::kReset});
}

void VirtualUsbController::connect(bool on) noexcept {
  if (on == joined_) {
    return;
  }
  clear_bus();
  joined_ = on;
  if (present()) {
    appear();
  }
}

firmware::UsbSpeed VirtualUsbController::speed() noexcept {
  if (!present()) {
    return firmware::UsbSpeed::kNone;
  }
  return speed_ == UsbBusSpeed::kHigh ? firmware::UsbSpeed::kHigh : firmware::UsbSpeed::kFull;
}

UsbEvent VirtualUsbController::next_event() noexcept {
  if (!events_.empty()) {
    const UsbEvent event = events_.front();
    events_.pop_front();
    return event;
  }
  return control_.next_event().value_or(UsbEvent{});
}

void VirtualUsbController::control_send(std::span<const std::byte> data) noexcept {
  control_.send(data);
}
void VirtualUsbController::control_receive(std::span<std::byte> room) noexcept {
  control_.receive(room);
}
void VirtualUsbController::control_accept() noexcept {
  control_.accept();
}
void VirtualUsbController::control_stall() noexcept {
  control_.stall();
}
void VirtualUsbController::set_address(std::uint8_t address) noexcept {
  address_ = address;
}

void VirtualUsbController::open_endpoints(std::span<const UsbEndpoint> endpoints) noexcept {
  to_host_.clear();
  to_device_.clear();
  open_pipes(ins_, endpoints, true, [this](const UsbEndpoint& endpoint) {
    ins_.emplace_back(endpoint, endpoint.type == UsbEndpoint::Type::kBulk ? &in_faults_ : nullptr,
                      completions_);
  });
  open_pipes(outs_, endpoints, false, [this](const UsbEndpoint& endpoint) {
    outs_.emplace_back(endpoint, endpoint.type == UsbEndpoint::Type::kBulk ? &to_device_ : nullptr,
                       completions_);
  });
}

std::size_t VirtualUsbController::write(std::uint8_t endpoint, std::span<const std::byte> bytes) noexcept {
  InPipe* const pipe = in_pipe(endpoint);
  if (pipe == nullptr) {
    return 0;
  }
  const InPipe::Written written = pipe->write(bytes, clock_.now_us());
  if (written.broken) {
    unplug();
  }
  return written.taken;
}

void VirtualUsbController::end_transfer(std::uint8_t endpoint) noexcept {
  InPipe* const pipe = in_pipe(endpoint);
  if (pipe != nullptr && pipe->end_transfer(clock_.now_us())) {
    unplug();
  }
}

std::size_t VirtualUsbController::waiting(std::uint8_t endpoint) noexcept {
  const InPipe* const pipe = in_pipe(endpoint);
  return pipe == nullptr ? 0 : pipe->waiting();
}

std::size_t VirtualUsbController::read(std::uint8_t endpoint, std::span<std::byte> out) noexcept {
  OutPipe* const pipe = out_pipe(endpoint);
  if (pipe == nullptr) {
    return 0;
  }
  const OutPipe::Taken taken = pipe->read(out, clock_.now_us());
  if (taken.broken) {
    unplug();
  }
  return taken.size;
}

void VirtualUsbController::set_halt(std::uint8_t endpoint, bool halted) noexcept {
  if (InPipe* const in = in_pipe(endpoint)) {
    in->set_halt(halted);
  } else if (OutPipe* const out = out_pipe(endpoint)) {
    out->set_halt(halted);
  }
}

bool VirtualUsbController::halted(std::uint8_t endpoint) noexcept {
  const InPipe* const in = in_pipe(endpoint);
  const OutPipe* const out = out_pipe(endpoint);
  return (in != nullptr && in->halted()) || (out != nullptr && out->halted());
}

void VirtualUsbController::plug(UsbBusSpeed speed) {
  if (plugged_) {
    unplug();
  }
  plugged_ = true;
  speed_ = speed;
  if (joined_) {
    appear();
  }
}

void VirtualUsbController::unplug() {
  if (!plugged_) {
    return;
  }
  clear_bus();
  plugged_ = false;
  if (joined_) {
    events_.push_back({.kind = UsbEvent::Kind::kUnplugged});
  }
}

void VirtualUsbController::reset() {
  if (present()) {
    clear_bus();
    events_.push_back({.kind = UsbEvent::Kind::kReset});
  }
}

void VirtualUsbController::submit(UsbTransfer transfer) {
  const bool in =
      (transfer.endpoint & kEndpointNumber) == 0 ? is_in(transfer.setup[0]) : is_in(transfer.endpoint);
  const auto refuse = [&](UsbOutcome outcome) {
    if (in) {
      completions_.add_in(transfer.id, outcome, {});
    } else {
      completions_.add_out(transfer.id, outcome, 0);
    }
  };
  if (!present()) {
    refuse(UsbOutcome::kGone);
    return;
  }
  if ((transfer.endpoint & kEndpointNumber) == 0) {
    control_.submit(std::move(transfer));
    return;
  }
  InPipe* const to_host = in_pipe(transfer.endpoint);
  OutPipe* const to_device = out_pipe(transfer.endpoint);
  if (to_host == nullptr && to_device == nullptr) {
    refuse(UsbOutcome::kError);
    return;
  }
  if (to_host != nullptr ? to_host->submit(std::move(transfer), clock_.now_us())
                         : to_device->submit(std::move(transfer), clock_.now_us())) {
    unplug();
  }
}

bool VirtualUsbController::cancel(std::uint64_t id) {
  if (control_.cancel(id)) {
    return true;
  }
  for (InPipe& pipe : ins_) {
    bool broken = false;
    if (pipe.cancel(id, broken, clock_.now_us())) {
      if (broken) {
        unplug();
      }
      return true;
    }
  }
  return std::ranges::any_of(outs_, [id](OutPipe& pipe) { return pipe.cancel(id); });
}

std::optional<UsbCompletion> VirtualUsbController::next_completion() {
  std::optional<UsbCompletion> first = completions_.take();
  if (first && completions_.empty() && completion_taken_) {
    completion_taken_();
  }
  return first;
}

std::size_t VirtualUsbController::under_way() const {
  std::size_t count = control_.under_way();
  for (const InPipe& pipe : ins_) {
    count += pipe.under_way();
  }
  for (const OutPipe& pipe : outs_) {
    count += pipe.under_way();
  }
  return count;
}

bool VirtualUsbController::host_is_slow() const {
  return std::ranges::any_of(ins_, [](const InPipe& pipe) { return pipe.host_is_slow(); });
}

void VirtualUsbController::tick() {
  const std::uint64_t now = clock_.now_us();
  bool broken = false;
  for (InPipe& pipe : ins_) {
    broken = pipe.tick(now) || broken;
  }
  for (OutPipe& pipe : outs_) {
    broken = pipe.tick(now) || broken;
  }
  if (broken) {
    unplug();
  }
}

std::optional<std::uint64_t> VirtualUsbController::next_event_us() const noexcept {
  const std::optional<std::uint64_t> to_host = to_host_.next_event_us();
  const std::optional<std::uint64_t> to_device = to_device_.next_event_us();
  if (!to_host || !to_device) {
    return to_host ? to_host : to_device;
  }
  return std::min(*to_host, *to_device);
}

InPipe* VirtualUsbController::in_pipe(std::uint8_t endpoint) noexcept {
  return find(ins_, endpoint);
}
OutPipe* VirtualUsbController::out_pipe(std::uint8_t endpoint) noexcept {
  return find(outs_, endpoint);
}

}  // namespace scatter::simulator
