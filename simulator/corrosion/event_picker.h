// Lists of cells from which one is picked at random by weight, many times and fast.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "simulator/random/bulk.h"

namespace scatter::corrosion {

/// How many candidates ahead a list's slot and the cell named there are fetched from memory. The random words
/// are drawn in bulk, so the coming candidates are known long before the events between have happened; what
/// those change makes a fetch useless now and then, never a pick wrong.
inline constexpr std::uint32_t kFetchSlotAhead = 48;
inline constexpr std::uint32_t kFetchCellAhead = 24;

/// A place in a picker's lists; stays valid while cells are only added.
struct Pick {
  std::uint32_t cell;
  std::uint32_t slot;
  std::uint32_t list;
};

/// A growing and shrinking list whose slots are drawn below a bound that is a little more than its length and
/// changes only now and then: so the slots that coming random words mean are known ahead. Slots beyond the
/// end are dropped; what remains is uniform over the list.
class CellList {
 public:
  /// `cells` is how long it may get.
  explicit CellList(std::size_t cells) {
    cells_.reserve(cells + kRoom);
    cells_.resize(kRoom);
  }

  [[nodiscard]] std::uint32_t size() const noexcept { return size_; }
  [[nodiscard]] std::uint32_t bound() const noexcept { return bound_; }
  [[nodiscard]] const std::uint32_t* data() const noexcept { return cells_.data(); }
  /// Uniform below the bound, to within bound / 2^32; may be read in data() whatever the list's length is.
  [[nodiscard]] std::uint32_t slot(std::uint32_t word) const noexcept {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(word) * bound_ >> 32U);
  }

  void add(std::uint32_t cell) {
    make_room();
    cells_[size_++] = cell;
    grown();
  }
  /// The cells of a set (Around) about `cell`.
  void add_around(std::uint32_t cell, std::uint32_t side, std::uint32_t set) {
    make_room();
    // Four are written whatever their number, and the end moved by those that count: how many there are is as
    // good as random, and a branch on it would be guessed wrong every other time.
    std::uint32_t* end = cells_.data() + size_;
    std::uint32_t base = cell - side - 1;
    for (std::uint32_t row = 0; row < 3; ++row) {
      const Columns& columns = kColumns[(set >> 3 * row) & 7U];
      for (std::size_t i = 0; i < 4; ++i) {
        end[i] = base + columns.offset[i];
      }
      end += columns.count;
      base += side;
    }
    size_ = static_cast<std::uint32_t>(end - cells_.data());
    grown();
  }
  void remove(std::uint32_t slot) {
    cells_[slot] = cells_[--size_];
    if (size_ + 2 * step_ < bound_) {
      set_bound();
    }
  }

 private:
  /// For the adds of one event.
  static constexpr std::size_t kRoom = 16;
  struct Columns {
    std::uint32_t offset[4];
    std::uint32_t count;
  };
  static constexpr Columns kColumns[8] = {{{0, 0, 0, 0}, 0}, {{0, 0, 0, 0}, 1}, {{1, 0, 0, 0}, 1},
                                          {{0, 1, 0, 0}, 2}, {{2, 0, 0, 0}, 1}, {{0, 2, 0, 0}, 2},
                                          {{1, 2, 0, 0}, 2}, {{0, 1, 2, 0}, 3}};

  void make_room() {
    if (size_ + kRoom > cells_.size()) {
      cells_.resize(2 * cells_.size());
    }
  }
  void grown() noexcept {
    if (size_ > bound_) {
      set_bound();
    }
  }
  /// The next multiple of about a sixteenth of the length.
  void set_bound() noexcept {
    step_ = std::max(std::bit_floor(size_) / 16, 1U);
    bound_ = (size_ + step_ - 1) / step_ * step_;
  }

  std::vector<std::uint32_t> cells_;  ///< Longer than the bound: every slot may be read.
  std::uint32_t size_ = 0;
  std::uint32_t bound_ = 0;
  std::uint32_t step_ = 1;
};

/// Picks among cells of one weight.
class EvenPicker {
 public:
  EvenPicker(const simulator::RandomKey& key, std::size_t cells) : key_(key), list_(cells) { draw(0); }

  [[nodiscard]] bool empty() const noexcept { return list_.size() == 0; }
  void add(std::uint32_t cell) { list_.add(cell); }
  void add_around(std::uint32_t cell, std::uint32_t side, std::uint32_t set) {
    list_.add_around(cell, side, set);
  }
  void remove(const Pick& pick) { list_.remove(pick.slot); }

  /// One of the cells, each as likely; it stays. Needs !empty(). hint(cell): this cell may be picked soon.
  template <typename Hint>
  [[nodiscard]] Pick pick(Hint&& hint) {
    const std::uint32_t* const cells = list_.data();
    for (;;) {
      if (next_ % kChunk == 0) {
        draw(next_ / kChunk + 1);
      }
      __builtin_prefetch(cells + list_.slot(word(next_ + kFetchSlotAhead)));
      hint(cells[list_.slot(word(next_ + kFetchCellAhead))]);
      const std::uint32_t slot = list_.slot(word(next_++));
      if (slot < list_.size()) {
        return {cells[slot], slot, 0};
      }
    }
  }

 private:
  static constexpr std::uint64_t kChunk = 4 * simulator::kBulkBlocks;

  [[nodiscard]] std::uint32_t word(std::uint64_t i) const noexcept {
    return words_[(i / kChunk) % 2][i % kChunk];
  }
  void draw(std::uint64_t chunk) noexcept {
    simulator::draw_bulk(key_, static_cast<std::uint32_t>(chunk), words_[chunk % 2]);
  }

  simulator::RandomKey key_;
  CellList list_;
  std::uint64_t next_ = 0;
  std::array<simulator::BulkWords, 2> words_;  ///< The chunk of the next word and the one after.
};

/// Picks among cells of 16-bit weights. Cells whose weights share their highest bit share a list; a list is
/// drawn by the weight that it could hold at most, a slot in it, and the cell there is taken with the chance
/// that its weight has against the list's largest. All sums are of whole numbers and exact.
class WeightedPicker {
 public:
  /// `weights` must outlive this; cells of weight 0 are never picked.
  WeightedPicker(const simulator::RandomKey& key, std::span<const std::uint16_t> weights);

  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  void add(std::uint32_t cell) {
    const std::uint16_t weight = weights_[cell];
    if (weight != 0) {
      ++size_;
      change(static_cast<std::uint32_t>(std::bit_width(weight)) - 1,
             [cell](CellList& list) { list.add(cell); });
    }
  }
  void remove(const Pick& pick) {
    --size_;
    change(pick.list, [&pick](CellList& list) { list.remove(pick.slot); });
  }

  /// One of the cells, with a chance in proportion to its weight; it stays. Needs !empty().
  template <typename Hint>
  [[nodiscard]] Pick pick(Hint&& hint) {
    for (;;) {
      if (next_ % simulator::kBulkBlocks == 0) {
        draw(next_ / simulator::kBulkBlocks + 1);
      }
      Candidate& far = ahead_[(next_ + kFetchSlotAhead) % kAhead];
      far = candidate(next_ + kFetchSlotAhead);
      __builtin_prefetch(lists_[far.list].data() + far.slot);
      const Candidate near = ahead_[(next_ + kFetchCellAhead) % kAhead];
      const std::uint32_t soon = lists_[near.list].data()[near.slot];
      __builtin_prefetch(weights_.data() + soon);
      hint(soon);
      Candidate now = ahead_[next_ % kAhead];
      if (now.shares != version_) {
        now = candidate(next_);  // Found with other shares than today's.
      }
      ++next_;
      if (now.slot < lists_[now.list].size()) {
        const std::uint32_t cell = lists_[now.list].data()[now.slot];
        if (now.level < weights_[cell]) {
          return {cell, now.slot, now.list};
        }
      }
    }
  }

 private:
  static constexpr std::size_t kLists = 16;
  static constexpr std::uint32_t kAhead = 64;
  static_assert(kFetchSlotAhead < simulator::kBulkBlocks && kFetchCellAhead < kAhead);

  __extension__ using Wide = unsigned __int128;

  struct Candidate {
    std::uint32_t list;
    std::uint32_t slot;
    std::uint32_t level;   ///< Uniform below the list's largest weight: taken when below the cell's.
    std::uint32_t shares;  ///< Which shares it was found with.
  };

  [[nodiscard]] Candidate candidate(std::uint64_t i) const noexcept {
    const simulator::BulkWords& words = words_[(i / simulator::kBulkBlocks) % 2];
    const std::size_t block = i % simulator::kBulkBlocks;
    const auto word = [&](std::size_t w) -> std::uint64_t {
      return words[w * simulator::kBulkBlocks + block];
    };
    std::uint64_t x =
        static_cast<std::uint64_t>((static_cast<Wide>(word(0) << 32U | word(1)) * total_) >> 64U);
    std::uint32_t list = top_;
    while (x >= shares_[list] && list > 0) {
      x -= shares_[list--];
    }
    return {list, lists_[list].slot(static_cast<std::uint32_t>(word(2))),
            static_cast<std::uint32_t>((word(3) * largest_[list]) >> 32U), version_};
  }
  void draw(std::uint64_t chunk) noexcept {
    simulator::draw_bulk(key_, static_cast<std::uint32_t>(chunk), words_[chunk % 2]);
  }
  template <typename Change>
  void change(std::uint32_t list, Change&& apply) {
    apply(lists_[list]);
    // An empty list is not drawn at all.
    const std::uint64_t slots = lists_[list].size() == 0 ? 0 : std::uint64_t{lists_[list].bound()};
    const std::uint64_t share = slots * largest_[list];
    if (share != shares_[list]) {
      total_ += share - shares_[list];
      shares_[list] = share;
      ++version_;
    }
  }

  simulator::RandomKey key_;
  std::span<const std::uint16_t> weights_;
  std::vector<CellList> lists_;
  std::array<std::uint32_t, kLists> largest_{};  ///< Of the weights of the sheet that belong to the list.
  std::array<std::uint64_t, kLists> shares_{};   ///< Its bound times the largest weight.
  std::uint64_t total_ = 0;
  std::uint32_t version_ = 1;  ///< Counts changes of the shares.
  std::uint32_t top_ = 0;      ///< The highest list that can hold a cell.
  std::size_t size_ = 0;
  std::uint64_t next_ = 0;
  std::array<Candidate, kAhead> ahead_{};
  std::array<simulator::BulkWords, 2> words_;
};

}  // namespace scatter::corrosion
