// Any bytes in the flash of the calibration store: raw ones anywhere, and records forged with right
// checksums and any payload, number and version. Promises:
// - what is served comes whole from one committed record, the newest there is, or nothing is;
// - a later version's record keeps every cell as it is and changes are refused;
// - otherwise a commit works and the next power-on has it;
// - no cell is programmed that is not erased.
#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "firmware/core/persistent_state.h"
#include "protocol/codec.h"
#include "protocol/crc.h"
#include "protocol/endian.h"
#include "simulator/faults/cut_flash.h"
#include "tests/fuzz/input.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::Input;
using scatter::fuzz::require;
using namespace scatter::firmware;
using namespace scatter::protocol;
using scatter::simulator::CutFlash;
using scatter::simulator::Supply;

namespace {

using Bytes = std::vector<std::byte>;

// One place per unit, and two units per place: both kinds of layout of record_store.h.
constexpr std::array<Flash::Geometry, 2> kGeometries{{{.unit_bytes = 2048, .units = 4, .program_bytes = 8},
                                                      {.unit_bytes = 1024, .units = 8, .program_bytes = 64}}};
constexpr std::uint32_t kFlashBytes = 8192;
constexpr std::uint32_t kPlaceStep = 2048;  // Where records can begin, in both.

/// A payload of entries, most of them as the store writes them.
Bytes payload_from(Input& input) {
  Bytes payload;
  for (int i = input.byte() % 12; i > 0; --i) {
    const std::uint8_t choice = input.byte();
    Bytes entry = input.some(choice);
    std::uint16_t kind = choice % 8;
    if (choice < 128) {
      CalibrationManifest manifest;
      manifest.kind = static_cast<Target>(choice % 6);
      manifest.id.fill(input.byte());
      manifest.sequence = input.word();
      kind = 1;
      entry.resize(encoded_size(manifest));
      require(encode(manifest, entry) == entry.size());
    }
    const std::size_t at = payload.size();
    payload.resize(at + 4);
    store_le(payload.data() + at, kind);
    store_le(payload.data() + at + 2, static_cast<std::uint16_t>(entry.size() + (choice == 255 ? 1 : 0)));
    payload.insert(payload.end(), entry.begin(), entry.end());
  }
  return payload;
}

void forge_record(Input& input, CutFlash& flash, std::uint32_t granule) {
  const std::uint8_t choice = input.byte();
  const std::uint32_t place = choice % 4 * kPlaceStep;
  const std::uint16_t version = choice < 250 ? 1 : choice - 248;
  std::uint64_t number = input.word();
  if (input.byte() == 0) {
    number <<= 48U;
  }
  Bytes record(24);
  const Bytes payload = payload_from(input);
  store_le(record.data(), 0x4352534FU);
  store_le(record.data() + 4, version);
  store_le(record.data() + 6, std::uint16_t{24});
  store_le(record.data() + 8, number);
  store_le(record.data() + 16, static_cast<std::uint32_t>(payload.size()));
  store_le(record.data() + 20, crc32c(std::span(record).first(20)));
  record.insert(record.end(), payload.begin(), payload.end());
  record.resize((record.size() + granule - 1) / granule * granule, std::byte{0xFF});
  const std::uint32_t crc = crc32c(record);
  const std::size_t commit = record.size();
  record.resize(commit + 8);
  store_le(record.data() + commit, crc);
  const std::span<const std::byte> view(record);
  store_le(record.data() + commit + 4, crc32c(view.subspan(commit, 4), crc32c(view.subspan(8, 8))));
  if (record.size() <= kPlaceStep) {
    flash.overwrite(place, record);
  }
}

struct Committed {
  std::uint64_t number;
  std::vector<CalibrationManifest> manifests;
};

/// The records that the documented rules call whole, read independently of the store.
struct Contents {
  std::vector<Committed> records;
  bool later_version = false;
};

Contents contents_of(CutFlash& flash, std::uint32_t granule) {
  Contents contents;
  for (std::uint32_t place = 0; place < kFlashBytes; place += kPlaceStep) {
    Bytes bytes(kPlaceStep);
    require(flash.read(place, bytes));
    const std::span<const std::byte> view(bytes);
    if (load_le<std::uint32_t>(bytes.data()) != 0x4352534FU ||
        load_le<std::uint32_t>(bytes.data() + 20) != crc32c(view.first(20))) {
      continue;
    }
    const auto version = load_le<std::uint16_t>(bytes.data() + 4);
    contents.later_version = contents.later_version || version > 1;
    const auto number = load_le<std::uint64_t>(bytes.data() + 8);
    const auto length = load_le<std::uint32_t>(bytes.data() + 16);
    if (version != 1 || length > 1280 || number == 0 || number >= std::uint64_t{1} << 62U) {
      continue;
    }
    const std::size_t body = (24 + length + granule - 1) / granule * granule;
    const std::uint32_t crc = crc32c(view.first(body));
    if (load_le<std::uint32_t>(bytes.data() + body) != crc ||
        load_le<std::uint32_t>(bytes.data() + body + 4) !=
            crc32c(view.subspan(body, 4), crc32c(view.subspan(8, 8)))) {
      continue;
    }
    Committed record{.number = number, .manifests = {}};
    std::span<const std::byte> rest = view.subspan(24, length);
    while (rest.size() >= 4 && 4U + load_le<std::uint16_t>(rest.data() + 2) <= rest.size()) {
      const std::span<const std::byte> entry = rest.subspan(4, load_le<std::uint16_t>(rest.data() + 2));
      if (load_le<std::uint16_t>(rest.data()) == 1) {
        if (const auto manifest = decode<CalibrationManifest>(entry)) {
          record.manifests.push_back(*manifest);
        }
      }
      rest = rest.subspan(4 + entry.size());
    }
    contents.records.push_back(std::move(record));
  }
  return contents;
}

/// All of `listed` stands in one record with the highest number.
bool comes_from_newest(const CalibrationListed& listed, const std::vector<Committed>& records) {
  std::uint64_t highest = 0;
  for (const Committed& record : records) {
    highest = std::max(highest, record.number);
  }
  return (listed.manifests.empty() && records.empty()) ||
         std::ranges::any_of(records, [&](const Committed& record) {
           return record.number == highest &&
                  std::ranges::all_of(listed.manifests, [&](const auto& manifest) {
                    return std::ranges::find(record.manifests, manifest) != record.manifests.end();
                  });
         });
}

Bytes cells_of(CutFlash& flash) {
  Bytes bytes(kFlashBytes);
  require(flash.read(0, bytes));
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  const Flash::Geometry geometry = kGeometries[input.byte() % kGeometries.size()];
  Supply supply;
  CutFlash flash(geometry, supply);
  while (!input.empty()) {
    if (input.byte() % 4 != 0) {
      forge_record(input, flash, geometry.program_bytes);
    } else {
      const std::uint32_t offset = input.word() % kFlashBytes;
      const Bytes raw = input.some(std::min<std::size_t>(input.byte(), kFlashBytes - offset));
      flash.overwrite(offset, raw);
    }
  }
  const Contents contents = contents_of(flash, geometry.program_bytes);
  const Bytes before = cells_of(flash);

  const Descriptor descriptor;
  CalibrationManifest manifest;
  manifest.kind = Target::kDarkCap;
  manifest.id.fill(0xA5);
  {
    PersistentState state(flash, descriptor);
    state.mount();
    if (contents.later_version) {
      require(state.report().condition == StoreReport::Condition::kLaterVersion);
      require(state.calibrations().list().manifests.empty());
      require(state.commit(manifest) == StatusCode::kFailedPrecondition);
      require(state.restore_factory() == StatusCode::kFailedPrecondition);
      require(cells_of(flash) == before);
      return 0;
    }
    require(state.mounted());
    require(state.report().whole_copies == 2);
    require((state.report().copy_used != 0) == !contents.records.empty());
    require(comes_from_newest(state.calibrations().list(), contents.records));
    require(state.commit(manifest) == StatusCode::kOk);
  }
  PersistentState state(flash, descriptor);
  state.mount();
  require(state.mounted());
  require(state.report().condition == StoreReport::Condition::kWhole);
  require(state.calibrations().current_id(Target::kDarkCap) == manifest.id);
  require(flash.violations() == 0);
  return 0;
}
