// The end of somebody's right to act, as the parts see it that act in somebody's name.
//
// An actor is a session of a page ("user:anna/session:4") or a token ("token:ci"). Plain values. Loop thread.
#pragma once

#include <functional>
#include <list>
#include <string>
#include <utility>

namespace server::runtime {

struct EndedRight {
  std::function<bool(const std::string& actor)> is_of;  // whether it was this actor's
  std::string why;                                      // for people: "token 'ci' was revoked by token:local"
};

// Requests that wait for the disk or the worker. SAFETY: one whose right ends meanwhile begins nothing afterwards.
class RequestsOnTheirWay {
 public:
  // One of them, for as long as it lives.
  class Request {
   public:
    Request(RequestsOnTheirWay& all, std::string actor) : all_{all.requests_} {
      all_.push_front({std::move(actor), {}});
      own_ = all_.begin();
    }
    ~Request() { all_.erase(own_); }
    Request(const Request&) = delete;
    Request& operator=(const Request&) = delete;
    const std::string& ended() const { return own_->ended; }  // why its right has ended; empty: it has not

   private:
    struct Entry {
      std::string actor, ended;
    };
    friend class RequestsOnTheirWay;
    std::list<Entry>& all_;
    std::list<Entry>::iterator own_;
  };

  std::size_t size() const { return requests_.size(); }
  void end(const EndedRight& right) {
    for (Request::Entry& request : requests_) {
      if (right.is_of(request.actor)) request.ended = right.why;
    }
  }

 private:
  std::list<Request::Entry> requests_;
};

}  // namespace server::runtime
