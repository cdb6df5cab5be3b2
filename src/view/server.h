#pragma once
// A Session on the loopback address, for one page of one browser.

#include <functional>
#include <memory>
#include <string>

#include "view/beginning.h"
#include "view/session.h"

namespace birefit::view {

/// Serves `session` until it is destroyed. Whoever does not know the token of the address gets nothing, nor does a page
/// of another origin, or one that reached this machine by another name.
class Server {
 public:
  /// At this port of 127.0.0.1; 0: one that is free. Throws UserError where there is none to be had.
  /// `beginning`: where the session has nothing to show until a config is made of an image; may be null.
  Server(Session& session, int port, const Beginning* beginning = nullptr);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// "http://127.0.0.1:4711/2f..c0/": what the user opens.
  const std::string& address() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace birefit::view
