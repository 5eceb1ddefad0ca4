// One function per check of conformance.cpp's table. Each opens the device itself and leaves it idle.
#pragma once

#include "host_sdk/device/conformance/judgement.h"
#include "host_sdk/device/conformance/subject.h"

namespace scatter::conformance {

// session_checks.cpp
void check_hello(Subject& subject, Judgement& judge);
void check_payload_limit(Subject& subject, Judgement& judge);
void check_version_refusal(Subject& subject, Judgement& judge);
void check_before_hello(Subject& subject, Judgement& judge);
void check_sequence(Subject& subject, Judgement& judge);
void check_stale_session(Subject& subject, Judgement& judge);
void check_new_session_ends_run(Subject& subject, Judgement& judge);

// request_checks.cpp
void check_one_reply(Subject& subject, Judgement& judge);
void check_repeated_request(Subject& subject, Judgement& judge);
void check_unknown_messages(Subject& subject, Judgement& judge);
void check_bad_payload(Subject& subject, Judgement& judge);
void check_payload_evolution(Subject& subject, Judgement& judge);
void check_flags(Subject& subject, Judgement& judge);
void check_garbage(Subject& subject, Judgement& judge);
void check_damaged_frames(Subject& subject, Judgement& judge);
void check_cut_frame(Subject& subject, Judgement& judge);

// identity_checks.cpp
void check_descriptor(Subject& subject, Judgement& judge);
void check_objects(Subject& subject, Judgement& judge);
void check_settings(Subject& subject, Judgement& judge);
void check_clock(Subject& subject, Judgement& judge);
void check_temperatures(Subject& subject, Judgement& judge);

// recipe_checks.cpp
void check_configuration(Subject& subject, Judgement& judge);
void check_pattern_mono16(Subject& subject, Judgement& judge);
void check_pattern_mono10p(Subject& subject, Judgement& judge);
void check_pattern_mono12p(Subject& subject, Judgement& judge);
void check_window(Subject& subject, Judgement& judge);
void check_illuminations(Subject& subject, Judgement& judge);

// run_checks.cpp
void check_run_completed(Subject& subject, Judgement& judge);
void check_run_stopped(Subject& subject, Judgement& judge);
void check_run_aborted(Subject& subject, Judgement& judge);
void check_run_order(Subject& subject, Judgement& judge);
void check_credit_hold(Subject& subject, Judgement& judge);
void check_live_preview(Subject& subject, Judgement& judge);

// timing_checks.cpp
void check_stop_latency(Subject& subject, Judgement& judge);
void check_round_trip(Subject& subject, Judgement& judge);
void check_throughput(Subject& subject, Judgement& judge);
void check_main_loop(Subject& subject, Judgement& judge);

// store_checks.cpp
void check_calibration_rules(Subject& subject, Judgement& judge);
void check_settings_persist(Subject& subject, Judgement& judge);
void check_calibration_persists(Subject& subject, Judgement& judge);

// update_checks.cpp
void check_fault_record(Subject& subject, Judgement& judge);
void check_update_refusals(Subject& subject, Judgement& judge);

}  // namespace scatter::conformance
