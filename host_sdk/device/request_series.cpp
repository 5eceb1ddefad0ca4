#include "host_sdk/device/request_series.h"

#include <algorithm>
#include <string>
#include <utility>

namespace scatter::device {
namespace {

constexpr Duration kFirstRetry = std::chrono::milliseconds(250);
constexpr Duration kLongestRetry = std::chrono::seconds(2);

}  // namespace

RequestSeries::RequestSeries(Session& session, std::size_t depth, Wait patience, std::function<void()> done)
    : session_(session),
      depth_(std::clamp<std::size_t>(depth, 1, kMaxDepth)),
      patience_(std::move(patience)),
      done_(std::move(done)) {
  session_.set_reply_sink(this);
}

RequestSeries::~RequestSeries() {
  session_.set_reply_sink(nullptr);
}

std::size_t RequestSeries::open() const noexcept {
  return static_cast<std::size_t>(
      std::ranges::count_if(places_, [](const Place& place) { return place.correlation != 0; }));
}

Status RequestSeries::push(protocol::MessageId id, std::string_view name, std::vector<std::byte> payload) {
  id_ = id;
  name_ = name;
  if (payload.size() > protocol::kMaxPayload) {
    return fail(ErrorCode::kInvalidArgument, std::string(name) + ": too long for the wire",
                "shorten the argument");
  }
  if (const Status room = wait_until_open(depth_ - 1); !room) {
    return room;
  }
  Place& place = *std::ranges::find_if(places_, [](const Place& one) { return one.correlation == 0; });
  const TimePoint now = session_.now();
  place = {.correlation = session_.next_correlation(),
           .payload = std::move(payload),
           .next_send = now,
           .pushed = now,
           .give_up = now + patience_.timeout,
           .spacing = std::clamp(3 * slowest_, kFirstRetry, kLongestRetry)};
  return wait_until_open(depth_);
}

Status RequestSeries::finish() {
  return wait_until_open(0);
}

Status RequestSeries::wait_until_open(std::size_t allowed) {
  for (;;) {
    if (session_.closed()) {
      return fail(ErrorCode::kDisconnected, std::string(name_) + ": the session is closed",
                  "open the device again");
    }
    const TimePoint now = session_.now();
    TimePoint wake = now + patience_.timeout;
    for (Place& place : places_) {
      if (place.correlation == 0) {
        continue;
      }
      if (now >= place.give_up) {
        return fail(ErrorCode::kDeadlineExceeded, std::string(name_) + ": the device did not answer in time",
                    "check that the device has power and the cable is good, then try again");
      }
      if (now >= place.next_send) {
        const Status sent =
            session_.send_request(id_, place.correlation, place.payload, place.give_up, patience_.stop);
        if (!sent) {
          return sent;
        }
        place.next_send = session_.now() + place.spacing;
        place.spacing = std::min(2 * place.spacing, kLongestRetry);
      }
      wake = std::min({wake, place.next_send, place.give_up});
    }
    if (failed_) {
      return std::unexpected(*failed_);
    }
    if (open() <= allowed) {
      return {};
    }
    const Status pumped = session_.pump(wake, patience_.stop);
    if (!pumped && pumped.error().code != ErrorCode::kDeadlineExceeded) {
      return pumped;
    }
  }
}

bool RequestSeries::on_reply(const protocol::Frame& frame) {
  const protocol::FrameHeader& header = frame.header();
  if (header.correlation == 0) {
    return false;
  }
  const auto place =
      std::ranges::find_if(places_, [&](const Place& one) { return one.correlation == header.correlation; });
  if (place == places_.end()) {
    return false;
  }
  const auto status = frame.as<protocol::StatusReply>();
  if (!status) {
    failed_ = Error{ErrorCode::kDataLoss, std::string(name_) + ": the device's reply cannot be read",
                    "update the device's firmware or the host's software"};
  } else if (status->status == protocol::StatusCode::kPending) {
    place->spacing = kLongestRetry;
    place->next_send = session_.now() + kLongestRetry;
    return true;
  } else if (status->status != protocol::StatusCode::kOk) {
    failed_ = device_error(name_, *status);
  } else {
    // What waits behind others on a slow link is not lost; repeating it would make the link slower still.
    slowest_ = std::max(slowest_, session_.now() - place->pushed);
    if (done_) {
      done_();
    }
  }
  place->correlation = 0;
  return true;
}

}  // namespace scatter::device
