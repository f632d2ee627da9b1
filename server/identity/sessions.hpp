// The sessions of pages, in memory: a cookie's hash, whose it is, and when it ends.
//
// A session ends kSessionValidity after its last use; an open /live is use. Each user has a bounded number of sessions:
// a new one replaces the one that was unused for longest. Accounts writes the changes. Loop thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <string>
#include <vector>

#include "server/identity/caller.hpp"

namespace server::identity {

inline constexpr microseconds kSessionValidity{std::chrono::hours{12}};  // from its last use
inline constexpr microseconds kSessionSaveInterval{std::chrono::hours{1}};
inline constexpr std::size_t kMaxSessionsOfLinks = 64;
inline constexpr std::size_t kMaxSessionsOfUser = 8;

class Sessions {
 public:
  struct Open : PageSession {
    std::shared_ptr<Standing> standing;
    std::int64_t saved_end_us = 0;  // at most an hour before ends_at_us
  };

  Sessions(boost::asio::io_context& loop, runtime::Clock& clock) : loop_{loop}, clock_{clock} {}

  void load(const std::vector<PageSession>& stored, std::uint64_t next_number);
  // Those of an older station, which kept them in a file: they were let in by links. How many were new.
  std::size_t take_over(const std::filesystem::path& file);

  std::string add(const std::string& user, const std::string& peer, const std::string& agent);  // its secret
  const Open* find(const std::string& secret);  // null: there is none; else it is used now, and so renewed

  bool end(std::uint64_t number);  // false: there is none
  void end_of_user(const std::string& user);
  void renew_standing(const std::string& user);  // open pages of the user come back with what they may do now

  void sweep();  // forgets what has ended; a page that is open uses its session

  const std::list<Open>& all() const { return sessions_; }
  static bool is_open(const Open& session);  // in a page
  std::vector<PageSession> rows() const;     // as they are to be stored
  std::uint64_t next_number() const { return next_number_; }
  std::uint64_t revision() const { return revision_; }  // grows with what is worth to be stored
  void on_saved();

 private:
  void make_room(const std::string& user);
  void renew(Open& session);
  void remove(std::list<Open>::iterator session);

  boost::asio::io_context& loop_;
  runtime::Clock& clock_;
  std::list<Open> sessions_;
  std::uint64_t next_number_ = 1;
  std::uint64_t revision_ = 0;
};

}  // namespace server::identity
