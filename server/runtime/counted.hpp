// Counts its own instances: how many coroutines are inside some piece of work.
#pragma once

namespace server::runtime {

template <class Number>
class Counted {
 public:
  explicit Counted(Number& count) : count_{count} { ++count_; }
  ~Counted() { --count_; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

 private:
  Number& count_;
};

}  // namespace server::runtime
