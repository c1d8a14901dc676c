// SPDX-License-Identifier: Apache-2.0
// Decides, before an event is appended to the log, whether the map can apply it.
//
// Events wait in the log between being appended and being applied, so the engine's state is not
// enough to decide: this class follows what was appended. The event log holds admitted events only;
// therefore an event that is in the log can always be applied.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "core/engine/event.h"
#include "core/engine/snapshot.h"

namespace loci {

// What admission knows of one session.
struct AdmittedSession {
  std::string session;
  std::string robot;
  Pose2 map_from_start;
  std::uint64_t last_number = 0;   // of the last observation, accepted or refused; 0 for none
  std::int64_t last_stamp_ns = 0;  // of the last accepted observation; meaningless if there is none
  bool any_accepted = false;
  bool open = true;
};

// Not thread-safe: the appender of a map owns it.
class AdmissionControl {
 public:
  // For an empty log.
  AdmissionControl() = default;
  // For a log whose last event is the snapshot's revision.
  static AdmissionControl FromSnapshot(const Snapshot& snapshot);

  // Whether the event may be appended now. Errors: kInvalidArgument (ValidateEvent),
  // kAlreadyExists, kNotFound (no such session), kFailedPrecondition (session closed; observation
  // out of turn: number is not last_number + 1).
  // An observation that is not newer than its session's last is kInvalidArgument too: the caller
  // then appends a RefuseObservationEvent, which consumes its number.
  Status Check(const Event& event) const;

  // Follows an event that is being appended. It must have passed Check.
  void Admit(const Event& event);

  // Null if there is none. `id` may be null.
  const AdmittedSession* Find(SessionId session) const;
  const AdmittedSession* FindByName(const std::string& session, SessionId* id) const;

 private:
  Status CheckInMap(const CreateMapEvent& event) const;
  Status CheckInMap(const OpenSessionEvent& event) const;
  Status CheckInMap(const ObservationEvent& event) const;
  Status CheckInMap(const RefuseObservationEvent& event) const;
  Status CheckInMap(const CloseSessionEvent& event) const;
  void AdmitAlternative(const CreateMapEvent& event);
  void AdmitAlternative(const OpenSessionEvent& event);
  void AdmitAlternative(const ObservationEvent& event);
  void AdmitAlternative(const RefuseObservationEvent& event);
  void AdmitAlternative(const CloseSessionEvent& event);
  AdmittedSession& OpenSessionAt(SessionId id);

  bool created_ = false;
  std::vector<AdmittedSession> sessions_;
  std::map<std::string, SessionId> by_name_;
};

}  // namespace loci
