// Lists of entries that wait for the same piece of work: standing in the list is the fact, so no flag repeats it.
//
//   struct Boot { WorkLink<Boot> due; };
//   WorkList<Boot, &Boot::due> due_boots;
//   due_boots.add(boot);                  // at the end; nothing happens if it stands there already
//   Boot* next = due_boots.take_first();  // null when the list is empty
//
// Plain bookkeeping. An entry may stand in several lists, by a link for each, but by one link in one list at a time.
// It must not move or end while it is listed: is_listed() says so. Everything is O(1) and allocates nothing, but for
// TimedWorkList, whose add() and take_due() are O(log n).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <queue>
#include <vector>

namespace server::storage {

// The place of an entry in one list.
template <class Entry>
class WorkLink {
 public:
  bool is_listed() const { return is_listed_; }

 private:
  template <class Listed, WorkLink<Listed> Listed::* member>
  friend class WorkList;
  Entry* before_ = nullptr;
  Entry* after_ = nullptr;
  bool is_listed_ = false;
};

// In the order in which they were added.
template <class Entry, WorkLink<Entry> Entry::* member>
class WorkList {
 public:
  WorkList() = default;
  WorkList(const WorkList&) = delete;
  WorkList& operator=(const WorkList&) = delete;

  bool empty() const { return first_ == nullptr; }
  std::size_t size() const { return size_; }
  Entry* first() const { return first_; }                                    // null: none
  Entry* after(const Entry& entry) const { return (entry.*member).after_; }  // null: it is the last

  void add(Entry& entry) {
    WorkLink<Entry>& link = entry.*member;
    if (link.is_listed_) return;
    link.is_listed_ = true;
    link.before_ = last_;
    (last_ == nullptr ? first_ : (last_->*member).after_) = &entry;
    last_ = &entry;
    ++size_;
  }

  void remove(Entry& entry) {
    WorkLink<Entry>& link = entry.*member;
    if (!link.is_listed_) return;
    (link.before_ == nullptr ? first_ : (link.before_->*member).after_) = link.after_;
    (link.after_ == nullptr ? last_ : (link.after_->*member).before_) = link.before_;
    link = {};
    --size_;
  }

  Entry* take_first() {
    Entry* entry = first_;
    if (entry != nullptr) remove(*entry);
    return entry;
  }

 private:
  Entry* first_ = nullptr;
  Entry* last_ = nullptr;
  std::size_t size_ = 0;
};

// The place of an entry in one list by time.
class TimedLink {
 public:
  bool is_listed() const { return is_listed_; }

 private:
  template <class Entry, TimedLink Entry::* member>
  friend class TimedWorkList;
  bool is_listed_ = false;
};

// By the time from which on each is due.
template <class Entry, TimedLink Entry::* member>
class TimedWorkList {
 public:
  TimedWorkList() = default;
  TimedWorkList(const TimedWorkList&) = delete;
  TimedWorkList& operator=(const TimedWorkList&) = delete;

  // An entry that stands there already keeps its time.
  void add(Entry& entry, std::int64_t due_us) {
    if ((entry.*member).is_listed_) return;
    (entry.*member).is_listed_ = true;
    entries_.push({due_us, &entry});
  }

  // Null: none is due yet.
  Entry* take_due(std::int64_t now_us) {
    if (entries_.empty() || entries_.top().due_us > now_us) return nullptr;
    Entry* entry = entries_.top().entry;
    entries_.pop();
    (entry->*member).is_listed_ = false;
    return entry;
  }

 private:
  struct Due {
    std::int64_t due_us = 0;
    Entry* entry = nullptr;
    bool operator>(const Due& other) const { return due_us > other.due_us; }
  };
  std::priority_queue<Due, std::vector<Due>, std::greater<>> entries_;
};

}  // namespace server::storage
