// What the device remembers. The checks that write put back what they found.
#include <algorithm>
#include <array>

#include "host_sdk/device/conformance/check_functions.h"

namespace scatter::conformance {

using protocol::CalibrationManifest;
using protocol::Target;

namespace {

constexpr std::array kKinds{Target::kDarkCap, Target::kWhiteReference, Target::kBlackReference,
                            Target::kTranslucentReference};
constexpr std::size_t kManifestsPerKind = 2;

std::vector<CalibrationManifest> of_kind(const std::vector<CalibrationManifest>& all, Target kind) {
  std::vector<CalibrationManifest> out;
  std::ranges::copy_if(all, std::back_inserter(out), [kind](const auto& m) { return m.kind == kind; });
  return out;
}

/// The same device after a restart. Errors  those of opening it within 20 s.
Result<device::Device> restarted(device::Device device, Subject& subject) {
  if (const Status status = device.reboot(subject.wait()); !status) {
    return std::unexpected(status.error());
  }
  {
    const device::Device gone = std::move(device);  // Closes the connection.
  }
  (void)subject.pause(std::chrono::milliseconds(300));
  return subject.device(std::chrono::seconds(20));
}

void judge_restart(const protocol::HelloReply& before, const protocol::HelloReply& after, Judgement& judge) {
  judge.equal("the boot count", before.boot_count + 1, after.boot_count);
  judge.equal("the reason of the reset", static_cast<int>(protocol::ResetReason::kRequested),
              int{after.reset_reason});
  judge.require(after.device_time_us < before.device_time_us + 60'000'000, "the clock did not start again");
}

CalibrationManifest made_up(Target kind, std::uint8_t number) {
  CalibrationManifest out;
  out.kind = kind;
  out.id.fill(number);
  out.certificate_id = std::string_view("conformance check");
  out.scalars.push_back(static_cast<float>(number));
  return out;
}

/// Commits manifests in a session of their own.
Status commit(device::Device& device, const CalibrationManifest& manifest, const Subject& subject) {
  const auto begun = device.calibration_begin(subject.wait());
  if (!begun) {
    return std::unexpected(begun.error());
  }
  const Status done = device.calibration_commit(begun->session, manifest, subject.wait());
  // A stage moves back to the sample.
  const Status ended = device.calibration_end(begun->session, subject.wait(std::chrono::seconds(30)));
  return done ? ended : done;
}

}  // namespace

void check_calibration_rules(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const auto listed = device->calibration_list(subject.wait());
  const auto states = device->calibration_query(subject.wait());
  if (!listed || !states) {
    return judge.broken("calibration_list and calibration_query", listed ? states.error() : listed.error());
  }
  for (const Target kind : kKinds) {
    const auto mine = of_kind(*listed, kind);
    judge.require(
        std::ranges::is_sorted(mine, std::ranges::greater(), &CalibrationManifest::sequence),
        fmt::format("the manifests of kind {} are not listed newest first", static_cast<int>(kind)));
    judge.require(std::ranges::none_of(mine, [](const auto& m) { return m.id == protocol::CalibrationId{}; }),
                  "a stored manifest has no id");
  }
  for (const protocol::CalibrationKindState& state : *states) {
    judge.require((state.verdict == protocol::CalibrationVerdict::kValid) == state.action.str().empty(),
                  fmt::format("kind {}: a verdict other than valid must say what to do, and valid must not",
                              static_cast<int>(state.kind)));
    const auto mine = of_kind(*listed, state.kind);
    judge.require(
        state.id == (mine.empty() ? protocol::CalibrationId{} : mine.front().id),
        fmt::format("kind {}: the calibration in force is not the newest one", static_cast<int>(state.kind)));
  }
  // Refusals that store nothing.
  judge.refused("a commit outside a session",
                device->calibration_commit(0xFFFF'FFFF, made_up(Target::kWhiteReference, 1), subject.wait()),
                ErrorCode::kFailedPrecondition);
  const auto begun = device->calibration_begin(subject.wait());
  if (!begun) {
    return judge.broken("calibration_begin", begun.error());
  }
  judge.refused(
      "a manifest without an id",
      device->calibration_commit(begun->session, made_up(Target::kWhiteReference, 0), subject.wait()),
      ErrorCode::kInvalidArgument);
  judge.refused("a manifest of the sample",
                device->calibration_commit(begun->session, made_up(Target::kSample, 1), subject.wait()),
                ErrorCode::kInvalidArgument);
  judge.refused("a step of another session",
                device->calibration_step(begun->session + 1, Target::kSample, subject.wait()),
                ErrorCode::kFailedPrecondition);
  if (const Status ended = device->calibration_end(begun->session, subject.wait(std::chrono::seconds(30)));
      !ended) {
    judge.broken("calibration_end", ended.error());
  }
  judge.refused("a second end of the session", device->calibration_end(begun->session, subject.wait()),
                ErrorCode::kFailedPrecondition);
  const auto after = device->calibration_list(subject.wait());
  judge.require(after && *after == *listed, "refused requests changed the stored calibrations");
  judge.measured(fmt::format("{} manifests stored", listed->size()));
}

void check_settings_persist(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  constexpr std::string_view kKey = "location";
  const auto found = device->key_value(kKey, subject.wait());
  if (!found) {
    return judge.broken("the setting 'location'", found.error());
  }
  judge.equal("read_only of 'location'", 0, int{found->read_only});
  const std::string old_value(found->value.str());
  const std::string new_value = fmt::format("conformance check {}", subject.next_nonce());
  if (const Status set = device->set_key_value(kKey, new_value, subject.wait()); !set) {
    return judge.broken("writing 'location'", set.error());
  }
  const auto expect = [&](std::string_view when, std::string_view value) {
    const auto now = device->key_value(kKey, subject.wait());
    if (!now) {
      return judge.broken(fmt::format("reading 'location' {}", when), now.error());
    }
    judge.equal(fmt::format("'location' {}", when), value, now->value.str());
  };
  expect("after writing it", new_value);
  const protocol::HelloReply before = device->hello();
  device = restarted(std::move(*device), subject);
  if (!device) {
    return judge.broken(fmt::format("a restart ('location' was '{}')", old_value), device.error());
  }
  judge_restart(before, device->hello(), judge);
  expect("after a restart", new_value);
  if (const Status set = device->set_key_value(kKey, old_value, subject.wait()); !set) {
    return judge.broken(fmt::format("putting 'location' back to '{}'", old_value), set.error());
  }
  expect("put back", old_value);
}

void check_calibration_persists(Subject& subject, Judgement& judge) {
  auto device = subject.device();
  if (!device) {
    return judge.broken("open", device.error());
  }
  const auto found = device->calibration_list(subject.wait());
  if (!found) {
    return judge.broken("calibration_list", found.error());
  }
  // Undo takes back exactly one commit, and the device keeps two per kind: what is put back must fit into
  // that.
  std::optional<Target> kind;
  for (const Target candidate : kKinds) {
    if (const auto count = of_kind(*found, candidate).size(); count > 0 && count < kManifestsPerKind) {
      kind = candidate;
    }
  }
  const bool nothing_stored = found->empty();
  if (!kind && !nothing_stored) {
    return judge.skip("every kind that holds a calibration holds two: a third would push one out for good");
  }
  const Target used = kind.value_or(Target::kTranslucentReference);
  const auto put_back = [&] {
    const Status done = nothing_stored ? device->calibration_restore_factory(subject.wait())
                                       : device->calibration_undo(used, subject.wait());
    const auto listed = device->calibration_list(subject.wait());
    if (!done || !listed) {
      return judge.broken("putting the calibrations back", done ? listed.error() : done.error());
    }
    judge.require(*listed == *found, "the calibrations are not what they were");
  };
  if (nothing_stored) {
    judge.refused("undo with nothing stored", device->calibration_undo(used, subject.wait()),
                  ErrorCode::kNotFound);
    if (const Status done = commit(*device, made_up(used, 0xC1), subject); !done) {
      return judge.broken("a first commit", done.error());
    }
    judge.refused("undo of the only calibration", device->calibration_undo(used, subject.wait()),
                  ErrorCode::kNotFound);
  }
  if (const Status done = commit(*device, made_up(used, 0xC2), subject); !done) {
    judge.broken("a commit", done.error());
    return put_back();
  }
  const auto stored = device->calibration_list(subject.wait());
  const protocol::HelloReply before = device->hello();
  device = restarted(std::move(*device), subject);
  if (!device || !stored) {
    return judge.broken("a restart (a made-up calibration of id C2... is stored)",
                        device ? stored.error() : device.error());
  }
  judge_restart(before, device->hello(), judge);
  const auto kept = device->calibration_list(subject.wait());
  judge.require(kept && *kept == *stored, "the stored calibrations are not the same after a restart");
  const auto mine = of_kind(*stored, used);
  judge.require(!mine.empty() && mine.front().id == made_up(used, 0xC2).id,
                "the newest calibration is not first");
  if (nothing_stored) {
    const Status undone = device->calibration_undo(used, subject.wait());
    const auto listed = device->calibration_list(subject.wait());
    judge.require(undone && listed && listed->size() == 1 && listed->front().id == made_up(used, 0xC1).id,
                  "undo did not bring back the earlier calibration");
  }
  put_back();
  judge.measured(
      fmt::format("kind {}, {} manifests before and after", static_cast<int>(used), found->size()));
}

}  // namespace scatter::conformance
