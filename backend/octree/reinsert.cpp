#include "backend/octree/reinsert.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

namespace octrace::octree {

namespace {

using Index = std::uint32_t;
constexpr Index kRoot = BinaryTree::kRoot;

float joined_half_area(const BinaryNode& a, const BinaryNode& b) {
  float extent[3];
  for (int i = 0; i < 3; ++i) {
    extent[i] = std::max(a.upper[i], b.upper[i]) - std::min(a.lower[i], b.lower[i]);
  }
  return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0];
}

struct Move {
  Index from = 0, to = 0;
  float gain = 0.0f;
  std::vector<Index> path;  // from the sibling of a node whose parent is known down to `to`
};

class Reinserter {
 public:
  Reinserter(BinaryNode* nodes, std::size_t size)
      : nodes_(nodes),
        parents_(std::make_unique_for_overwrite<Index[]>(size)),
        touched_(size, false) {
    parents_[kRoot] = 0;
  }

  bool run(const ReinsertOptions& options) {
    std::vector<Index> candidates = largest(options.most, options.least_area);
    float first_gain = 0.0f;
    for (int i = 0; i < options.rounds && !candidates.empty(); ++i) {
      const float gain = round(candidates, options);
      if (i == 0) first_gain = gain;
      if (!(gain > options.last_gain * first_gain)) break;
    }
    return first_gain > 0.0f;
  }

 private:
  // Moves what can be moved, and leaves in `candidates` those worth another look: moves that stood
  // in each other's way, and the nodes about those that were made. Returns by how much the sum of
  // surfaces fell.
  float round(std::vector<Index>& candidates, const ReinsertOptions& options) {
    std::vector<Move> moves(candidates.size());
    const auto search_all = [&](const auto& range) {
      Search search;
      for (std::size_t i = range.begin(); i < range.end(); ++i) {
        moves[i] = find(candidates[i], options.steps, search);
      }
    };
    const tbb::blocked_range<std::size_t> all_candidates(0, candidates.size(), 16);
    if (options.parallel) {
      tbb::parallel_for(all_candidates, search_all);
    } else {
      search_all(all_candidates);
    }
    std::erase_if(moves, [](const Move& move) { return move.gain <= 0.0f; });
    // Before anything moves: the searches saw this tree.
    for (const Move& move : moves) link(move);
    std::sort(moves.begin(), moves.end(), [](const Move& a, const Move& b) {
      return a.gain > b.gain || (a.gain == b.gain && a.from < b.from);
    });
    candidates.clear();
    float sum = 0.0f;
    for (const Move& move : moves) {
      const Index parent = parents_[move.from];
      const Index all[] = {move.from,        move.from ^ 1u, parent,
                           parents_[parent], move.to,        parents_[move.to]};
      const auto is_touched = [&](Index i) { return i > kRoot && touched_[i]; };
      if (std::any_of(std::begin(all), std::end(all), is_touched) || holds(move.from, move.to)) {
        candidates.push_back(move.from);
        continue;
      }
      for (const Index i : all) {
        touched_[i] = true;
        touched_list_.push_back(i);
      }
      apply(move);
      sum += move.gain;
    }
    for (const Index i : touched_list_) touched_[i] = false;
    candidates.insert(candidates.end(), touched_list_.begin(), touched_list_.end());
    touched_list_.clear();
    std::sort(candidates.begin(), candidates.end());
    candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
    std::erase_if(candidates, [&](Index i) { return parents_[i] <= kRoot; });
    return sum;
  }

  // Only the parents of nodes that were looked at and of those on the way to a move's target, with
  // their siblings, are ever asked for: most nodes of a tree are neither.
  void link(const Move& move) {
    Index parent = parents_[move.path[0] ^ 1u];
    for (const Index index : move.path) {
      parents_[index] = parents_[index ^ 1u] = parent;
      parent = index;
    }
  }

  // The nodes of the largest surfaces: as none is larger than its parent, they are found from the
  // root down. Children of the root cannot move. Sets the parents of what it sees.
  std::vector<Index> largest(std::size_t count, float least_area) {
    using Entry = std::pair<float, Index>;
    std::vector<Entry> heap = {{nodes_[kRoot].half_area(), kRoot}};
    std::vector<Index> found;
    while (!heap.empty() && found.size() < count && heap.front().first > least_area) {
      std::pop_heap(heap.begin(), heap.end());
      const Index index = heap.back().second;
      heap.pop_back();
      if (parents_[index] > kRoot) found.push_back(index);
      const BinaryNode& node = nodes_[index];
      if (node.leaf()) continue;
      for (const Index child : {2 * node.child, 2 * node.child + 1}) {
        parents_[child] = index;
        heap.emplace_back(nodes_[child].half_area(), child);
        std::push_heap(heap.begin(), heap.end());
      }
    }
    return found;
  }

  struct Step {
    float gain;
    Index index;
    Index above;  // the step to the parent, in `seen`; kNone: none
  };
  struct Search {
    std::vector<Step> stack;
    std::vector<Step> seen;
  };

  // Branch and bound from the node's sibling up to the root and down each way.
  Move find(Index from, std::size_t steps, Search& search) const {
    std::vector<Step>& stack = search.stack;
    std::vector<Step>& seen = search.seen;
    seen.clear();
    const BinaryNode& node = nodes_[from];
    const float area = node.half_area();
    const Index parent = parents_[from];
    Move best{from, 0, 0.0f, {}};
    Index best_step = kernels::kNone;
    float gain_here = nodes_[parent].half_area();
    Index sibling = from ^ 1u, pivot = parent;
    BinaryNode without = nodes_[sibling];  // the pivot's box without the node
    for (;;) {
      stack.push_back({gain_here, sibling, kernels::kNone});
      while (!stack.empty()) {
        const Step step = stack.back();
        stack.pop_back();
        if (step.gain - area <= best.gain) continue;
        if (seen.size() >= steps) {
          stack.clear();
          break;
        }
        const auto here = static_cast<Index>(seen.size());
        seen.push_back(step);
        const BinaryNode& to = nodes_[step.index];
        const float gain = step.gain - joined_half_area(to, node);
        if (gain > best.gain) {
          best.to = step.index;
          best.gain = gain;
          best_step = here;
        }
        if (to.leaf()) continue;
        const float below = gain + to.half_area();
        if (below - area <= best.gain) continue;
        stack.push_back({below, 2 * to.child, here});
        stack.push_back({below, 2 * to.child + 1, here});
      }
      if (pivot != parent) {
        const BinaryNode& other = nodes_[sibling];
        for (int a = 0; a < 3; ++a) {
          without.lower[a] = std::min(without.lower[a], other.lower[a]);
          without.upper[a] = std::max(without.upper[a], other.upper[a]);
        }
        gain_here += nodes_[pivot].half_area() - without.half_area();
      }
      if (pivot == kRoot || seen.size() >= steps) break;
      sibling = pivot ^ 1u;
      pivot = parents_[pivot];
    }
    if (best.to == (from ^ 1u) || best.to == parent) return {};
    for (Index i = best_step; i != kernels::kNone; i = seen[i].above) {
      best.path.push_back(seen[i].index);
    }
    std::reverse(best.path.begin(), best.path.end());
    return best;
  }

  // The sibling takes the parent's place, and the pair that is free now joins `from` with `to`.
  void apply(const Move& move) {
    const Index sibling = move.from ^ 1u, parent = parents_[move.from];
    const BinaryNode moved_up = nodes_[sibling], target = nodes_[move.to];
    nodes_[parent] = moved_up;
    adopt(parent);
    nodes_[sibling] = target;
    adopt(sibling);
    nodes_[move.to].child = sibling >> 1;
    parents_[sibling] = parents_[move.from] = move.to;
    refit(move.to);
    refit(parents_[parent]);
  }
  void adopt(Index index) {
    const BinaryNode& node = nodes_[index];
    if (!node.leaf()) parents_[2 * node.child] = parents_[2 * node.child + 1] = index;
  }
  // Up to where nothing changes.
  void refit(Index index) {
    for (; index != 0; index = parents_[index]) {
      BinaryNode& node = nodes_[index];
      const BinaryNode &a = nodes_[2 * node.child], &b = nodes_[2 * node.child + 1];
      bool changed = false;
      for (int axis = 0; axis < 3; ++axis) {
        const float lower = std::min(a.lower[axis], b.lower[axis]);
        const float upper = std::max(a.upper[axis], b.upper[axis]);
        changed |= lower != node.lower[axis] || upper != node.upper[axis];
        node.lower[axis] = lower;
        node.upper[axis] = upper;
      }
      if (!changed) return;
    }
  }

  // Another move of this round may have brought the target below the node itself.
  bool holds(Index node, Index target) const {
    for (; target != 0; target = parents_[target]) {
      if (target == node) return true;
    }
    return false;
  }

  BinaryNode* nodes_;
  std::unique_ptr<Index[]> parents_;
  std::vector<bool> touched_;  // by moves of this round
  std::vector<Index> touched_list_;
};

}  // namespace

bool reinsert(BinaryNode* nodes, std::size_t size, const ReinsertOptions& options) {
  if (options.rounds == 0 || nodes[kRoot].leaf()) return false;
  if (!(nodes[kRoot].half_area() > options.least_area)) return false;
  return Reinserter(nodes, size).run(options);
}

}  // namespace octrace::octree
