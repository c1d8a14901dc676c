// SPDX-License-Identifier: Apache-2.0
#include "core/engine/admission.h"

#include <utility>

namespace loci {
namespace {

// The session that an event names, if it is open and `number` is its turn.
StatusOr<const AdmittedSession*> CheckTurn(const AdmittedSession* session,
                                           SessionId id,
                                           std::uint64_t number) {
  if (session == nullptr) {
    return NotFoundError("session: there is none with id " + std::to_string(id.value));
  }
  if (!session->open) {
    return FailedPreconditionError("session: \"" + session->session + "\" is closed");
  }
  if (number != session->last_number + 1) {
    return FailedPreconditionError("number: " + std::to_string(number) + ", must be " +
                                   std::to_string(session->last_number + 1) +
                                   ", the next of session \"" + session->session + "\"");
  }
  return session;
}

}  // namespace

AdmissionControl AdmissionControl::FromSnapshot(const Snapshot& snapshot) {
  AdmissionControl admission;
  admission.created_ = snapshot.revision.value >= 1;
  for (const SessionSnapshot& session : snapshot.sessions) {
    const SessionId id{static_cast<std::uint32_t>(admission.sessions_.size())};
    LOCI_CHECK(session.id == id && admission.by_name_.emplace(session.session, id).second);
    admission.sessions_.push_back({.session = session.session,
                                   .robot = session.robot,
                                   .map_from_start = session.map_from_start,
                                   .last_number = session.last_number,
                                   .last_stamp_ns = session.last_stamp_ns,
                                   .any_accepted = session.accepted_count > 0,
                                   .open = session.open});
  }
  return admission;
}

Status AdmissionControl::Check(const Event& event) const {
  LOCI_RETURN_IF_ERROR(ValidateEvent(event, ""));
  if (std::holds_alternative<CreateMapEvent>(event)) {
    return created_ ? AlreadyExistsError("map: it was created before") : Status();
  }
  if (!created_) {
    return FailedPreconditionError("map: its first event must create it");
  }
  return std::visit([this](const auto& alternative) { return CheckInMap(alternative); }, event);
}

Status AdmissionControl::CheckInMap(const CreateMapEvent& /*event*/) const {
  return {};
}

Status AdmissionControl::CheckInMap(const OpenSessionEvent& event) const {
  if (FindByName(event.session, nullptr) != nullptr) {
    return AlreadyExistsError("session: \"" + event.session + "\" was opened before");
  }
  return {};
}

Status AdmissionControl::CheckInMap(const ObservationEvent& event) const {
  LOCI_ASSIGN_OR_RETURN(const AdmittedSession* session,
                        CheckTurn(Find(event.session), event.session, event.number));
  if (session->any_accepted && event.stamp_ns <= session->last_stamp_ns) {
    return InvalidArgumentError("stamp_ns: " + std::to_string(event.stamp_ns) + ", must be above " +
                                std::to_string(session->last_stamp_ns) +
                                ", the last of session \"" + session->session + "\"");
  }
  return {};
}

Status AdmissionControl::CheckInMap(const RefuseObservationEvent& event) const {
  return CheckTurn(Find(event.session), event.session, event.number).status();
}

Status AdmissionControl::CheckInMap(const CloseSessionEvent& event) const {
  const AdmittedSession* session = Find(event.session);
  if (session == nullptr) {
    return NotFoundError("session: there is none with id " + std::to_string(event.session.value));
  }
  if (!session->open) {
    return FailedPreconditionError("session: \"" + session->session + "\" is closed already");
  }
  return {};
}

void AdmissionControl::Admit(const Event& event) {
  LOCI_CHECK(created_ != std::holds_alternative<CreateMapEvent>(event));
  std::visit([this](const auto& alternative) { AdmitAlternative(alternative); }, event);
}

void AdmissionControl::AdmitAlternative(const CreateMapEvent& /*event*/) {
  created_ = true;
}

void AdmissionControl::AdmitAlternative(const OpenSessionEvent& event) {
  const SessionId id{static_cast<std::uint32_t>(sessions_.size())};
  LOCI_CHECK(by_name_.emplace(event.session, id).second);
  sessions_.push_back(
      {.session = event.session, .robot = event.robot, .map_from_start = event.map_from_start});
}

void AdmissionControl::AdmitAlternative(const ObservationEvent& event) {
  AdmittedSession& session = OpenSessionAt(event.session);
  LOCI_CHECK(event.number == session.last_number + 1);
  LOCI_CHECK(!session.any_accepted || event.stamp_ns > session.last_stamp_ns);
  session.last_number = event.number;
  session.last_stamp_ns = event.stamp_ns;
  session.any_accepted = true;
}

void AdmissionControl::AdmitAlternative(const RefuseObservationEvent& event) {
  AdmittedSession& session = OpenSessionAt(event.session);
  LOCI_CHECK(event.number == session.last_number + 1);
  session.last_number = event.number;
}

void AdmissionControl::AdmitAlternative(const CloseSessionEvent& event) {
  OpenSessionAt(event.session).open = false;
}

AdmittedSession& AdmissionControl::OpenSessionAt(SessionId id) {
  LOCI_CHECK(id.value < sessions_.size());
  AdmittedSession& session = sessions_[id.value];
  LOCI_CHECK(session.open);
  return session;
}

const AdmittedSession* AdmissionControl::Find(SessionId session) const {
  return session.value < sessions_.size() ? &sessions_[session.value] : nullptr;
}

const AdmittedSession* AdmissionControl::FindByName(const std::string& session,
                                                    SessionId* id) const {
  const auto found = by_name_.find(session);
  if (found == by_name_.end()) {
    return nullptr;
  }
  if (id != nullptr) {
    *id = found->second;
  }
  return Find(found->second);
}

}  // namespace loci
