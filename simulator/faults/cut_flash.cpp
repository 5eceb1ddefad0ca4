#include "simulator/faults/cut_flash.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace scatter::simulator {
namespace {

constexpr std::byte kErased{0xFF};

/// Source  Steele et al. 2014, "Fast splittable pseudorandom number generators" (SplitMix64).
constexpr std::uint64_t mixed(std::uint64_t x) noexcept {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31U);
}

constexpr std::uint64_t draw(std::uint64_t seed, std::uint64_t a, std::uint64_t b = 0) noexcept {
  return mixed(mixed(mixed(seed) ^ a) ^ b);
}

}  // namespace

CutFlash::CutFlash(Geometry geometry, Supply& supply)
    : geometry_(geometry),
      supply_(&supply),
      pages_((geometry.unit_bytes * geometry.units + kPageBytes - 1) / kPageBytes),
      erases_(geometry.units),
      worn_(geometry.units),
      weak_(geometry.units) {}

CutFlash::CutFlash(const CutFlash& other, Supply& supply) : CutFlash(other) {
  supply_ = &supply;
}

bool CutFlash::inside(std::uint32_t offset, std::size_t length) const noexcept {
  return offset <= bytes() && length <= bytes() - offset;
}

CutFlash::Cell CutFlash::cell(std::uint32_t offset) const noexcept {
  const Page& page = pages_[offset / kPageBytes];
  const std::uint32_t at = offset % kPageBytes;
  if (page.cells) {
    return (*page.cells)[at];
  }
  return page.sound ? Cell{.value = (*page.sound)[at]} : Cell{};
}

std::byte CutFlash::reading(const Cell& cell, std::uint32_t offset) const noexcept {
  if (cell.state != CellState::kUnstable) {
    return cell.value;
  }
  const std::uint64_t power_on = supply_->power_ons();
  switch (draw(cell.seed, power_on) % 4) {
    case 0:
      return cell.value;
    case 1:
      return cell.alternative;
    case 2:
      return draw(cell.seed, power_on, offset) % 2 == 0 ? cell.value : cell.alternative;
    default: {
      const auto mask = static_cast<std::byte>(draw(cell.seed, power_on, offset) & 0xFFU);
      return (cell.value & ~mask) | (cell.alternative & mask);
    }
  }
}

template <typename Change>
void CutFlash::edit(std::uint32_t offset, std::size_t length, Change&& change) {
  for (std::size_t done = 0; done < length;) {
    const auto at = offset + static_cast<std::uint32_t>(done);
    const std::uint32_t first = at % kPageBytes;
    const std::size_t count = std::min<std::size_t>(length - done, kPageBytes - first);
    Page& page = pages_[at / kPageBytes];
    auto cells = std::make_shared<Cells>();
    if (page.cells) {
      *cells = *page.cells;
    } else if (page.sound) {
      for (std::uint32_t i = 0; i < kPageBytes; ++i) {
        (*cells)[i].value = (*page.sound)[i];
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      change((*cells)[first + i], done + i);
    }
    page.sound.reset();
    page.cells.reset();
    if (!std::ranges::all_of(*cells, [](const Cell& c) { return c.state == CellState::kSound; })) {
      page.cells = std::move(cells);
    } else if (!std::ranges::all_of(*cells, [](const Cell& c) { return c.value == kErased; })) {
      auto sound = std::make_shared<Bytes>();
      std::ranges::transform(*cells, sound->begin(), [](const Cell& c) { return c.value; });
      page.sound = std::move(sound);
    }
    done += count;
  }
}

template <typename Value>
void CutFlash::set(std::uint32_t offset, std::size_t length, Value&& value) {
  for (std::size_t done = 0; done < length;) {
    const auto at = offset + static_cast<std::uint32_t>(done);
    const std::uint32_t first = at % kPageBytes;
    const std::size_t count = std::min<std::size_t>(length - done, kPageBytes - first);
    Page& page = pages_[at / kPageBytes];
    if (page.cells) {
      edit(at, count, [&](Cell& one, std::size_t i) { one = {.value = value(done + i)}; });
    } else {
      auto sound = std::make_shared<Bytes>();
      if (page.sound) {
        *sound = *page.sound;
      } else {
        sound->fill(kErased);
      }
      for (std::size_t i = 0; i < count; ++i) {
        (*sound)[first + i] = value(done + i);
      }
      page.sound = std::move(sound);
    }
    done += count;
  }
}

void CutFlash::set_erased(std::uint32_t offset, std::uint32_t length) {
  while (length > 0) {
    const std::uint32_t count = std::min(length, kPageBytes - offset % kPageBytes);
    if (count == kPageBytes) {
      pages_[offset / kPageBytes] = {};
    } else {
      set(offset, count, [](std::size_t) { return kErased; });
    }
    offset += count;
    length -= count;
  }
}

void CutFlash::violate(std::string what) noexcept {
  if (violations_++ == 0) {
    violation_ = std::move(what);
  }
}

bool CutFlash::begin_operation(bool& cut_now) noexcept {
  cut_now = false;
  if (supply_->lost_) {
    return false;
  }
  if (supply_->operations_++ == supply_->cut_.operation && supply_->armed_) {
    supply_->lost_ = true;
    cut_now = true;
    return false;
  }
  return true;
}

bool CutFlash::read(std::uint32_t offset, std::span<std::byte> out) noexcept {
  if (supply_->lost_) {
    return false;
  }
  if (!inside(offset, out.size())) {
    violate(fmt::format("read of {} B at {} leaves the part of {} B", out.size(), offset, bytes()));
    return false;
  }
  for (std::size_t done = 0; done < out.size();) {
    const auto at = offset + static_cast<std::uint32_t>(done);
    const std::uint32_t first = at % kPageBytes;
    const std::size_t count = std::min<std::size_t>(out.size() - done, kPageBytes - first);
    const Page& page = pages_[at / kPageBytes];
    const std::span<std::byte> piece = out.subspan(done, count);
    if (page.cells) {
      for (std::size_t i = 0; i < count; ++i) {
        const Cell& one = (*page.cells)[first + i];
        if (one.state == CellState::kTrapping) {
          return false;
        }
        piece[i] = reading(one, at + static_cast<std::uint32_t>(i));
      }
    } else if (page.sound) {
      std::copy_n(page.sound->begin() + first, count, piece.begin());
    } else {
      std::ranges::fill(piece, kErased);
    }
    done += count;
  }
  return true;
}

bool CutFlash::program(std::uint32_t offset, std::span<const std::byte> bytes_to_write) noexcept {
  if (supply_->lost_) {
    return false;
  }
  const std::size_t size = bytes_to_write.size();
  if (!inside(offset, size) || offset % geometry_.program_bytes != 0 || size % geometry_.program_bytes != 0) {
    violate(fmt::format("program of {} B at {}: part {} B, granule {} B", size, offset, bytes(),
                        geometry_.program_bytes));
    return false;
  }
  bool weak = false;
  std::uint32_t weak_seed = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const auto at = offset + static_cast<std::uint32_t>(i);
    const Cell one = cell(at);
    if (one.state == CellState::kTrapping || reading(one, at) != kErased) {
      violate(fmt::format("program of {} B at {}: cell {} is not erased", size, offset, at));
      return false;
    }
    if (one.state == CellState::kUnstable) {
      weak = true;
      weak_seed = one.seed;
    }
  }
  bool cut_now = false;
  if (!begin_operation(cut_now)) {
    if (cut_now) {
      break_program(offset, bytes_to_write);
    }
    return false;
  }
  for (std::size_t i = 0; i < size; i += geometry_.program_bytes) {
    if (worn_[(offset + i) / geometry_.unit_bytes]) {
      return false;
    }
  }
  if (weak && draw(weak_seed, supply_->power_ons(), offset) % 2 == 0) {
    edit(offset, size, [](Cell& one, std::size_t) { one.state = CellState::kTrapping; });
    return false;
  }
  set(offset, size, [&](std::size_t i) { return bytes_to_write[i]; });
  if (size > 0 && weak_[offset / geometry_.unit_bytes]) {
    set(offset, 1, [&](std::size_t) { return bytes_to_write[0] | std::byte{0x55}; });
  }
  return true;
}

bool CutFlash::erase(std::uint32_t unit) noexcept {
  if (supply_->lost_) {
    return false;
  }
  if (unit >= geometry_.units) {
    violate(fmt::format("erase of unit {}: the part has {}", unit, geometry_.units));
    return false;
  }
  const std::uint32_t offset = unit * geometry_.unit_bytes;
  bool cut_now = false;
  if (!begin_operation(cut_now)) {
    if (cut_now && !worn_[unit]) {
      break_erase(offset);
    }
    return false;
  }
  if (worn_[unit]) {
    return false;
  }
  ++erases_[unit];
  set_erased(offset, geometry_.unit_bytes);
  return true;
}

void CutFlash::break_program(std::uint32_t offset, std::span<const std::byte> wanted) {
  const PowerCut& cut = supply_->cut_;
  const std::uint64_t power_on = supply_->power_ons();
  switch (cut.kind) {
    case CutKind::kBefore:
      return;
    case CutKind::kTornPrefix: {
      const std::size_t torn = wanted.empty() ? 0 : draw(cut.detail, 1) % wanted.size();
      const auto lacking = static_cast<std::byte>(draw(cut.detail, 2) & 0xFFU);
      set(offset, std::min(torn + 1, wanted.size()),
          [&](std::size_t i) { return i < torn ? wanted[i] : wanted[i] | lacking; });
      return;
    }
    case CutKind::kHalfErased:
      set(offset, wanted.size(),
          [&](std::size_t i) { return wanted[i] | static_cast<std::byte>(draw(cut.detail, 2, i) & 0xFFU); });
      return;
    case CutKind::kAfter:
      set(offset, wanted.size(), [&](std::size_t i) { return wanted[i]; });
      return;
    case CutKind::kUnstable:
    case CutKind::kTrap: {
      const bool trap = cut.kind == CutKind::kTrap;
      const auto seed = static_cast<std::uint32_t>(draw(cut.detail, power_on, offset));
      edit(offset, wanted.size(), [&](Cell& one, std::size_t i) {
        one = {.value = one.value,
               .state = trap ? CellState::kTrapping : CellState::kUnstable,
               .alternative = wanted[i],
               .seed = seed};
      });
      return;
    }
  }
}

void CutFlash::break_erase(std::uint32_t offset) {
  const PowerCut& cut = supply_->cut_;
  const std::uint64_t power_on = supply_->power_ons();
  const std::uint32_t size = geometry_.unit_bytes;
  switch (cut.kind) {
    case CutKind::kBefore:
      return;
    case CutKind::kTornPrefix:
      set_erased(offset, static_cast<std::uint32_t>(draw(cut.detail, 1) % size));
      return;
    case CutKind::kHalfErased:
      edit(offset, size, [&](Cell& one, std::size_t i) {
        one = {.value = one.value | static_cast<std::byte>(draw(cut.detail, 2, i) & 0xFFU)};
      });
      return;
    case CutKind::kAfter:
      set_erased(offset, size);
      return;
    case CutKind::kUnstable:
    case CutKind::kTrap: {
      const bool trap = cut.kind == CutKind::kTrap;
      const auto seed = static_cast<std::uint32_t>(draw(cut.detail, power_on, offset));
      edit(offset, size, [&](Cell& one, std::size_t) {
        one = {.value = one.value,
               .state = trap ? CellState::kTrapping : CellState::kUnstable,
               .alternative = kErased,
               .seed = seed};
      });
      return;
    }
  }
}

void CutFlash::wear_out(std::uint32_t unit) {
  worn_.at(unit) = true;
}

void CutFlash::weaken(std::uint32_t unit) {
  weak_.at(unit) = true;
}

void CutFlash::rot(std::uint32_t offset, std::uint8_t flipped_bits) {
  edit(offset, 1,
       [flipped_bits](Cell& one, std::size_t) { one.value ^= static_cast<std::byte>(flipped_bits); });
}

void CutFlash::trap(std::uint32_t offset, std::uint32_t length) {
  edit(offset, length, [](Cell& one, std::size_t) { one.state = CellState::kTrapping; });
}

void CutFlash::overwrite(std::uint32_t offset, std::span<const std::byte> bytes_there) {
  set(offset, bytes_there.size(), [&](std::size_t i) { return bytes_there[i]; });
}

}  // namespace scatter::simulator
