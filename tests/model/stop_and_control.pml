/* A model of stop, clear, pending stop, lease, control and takeover, for Spin; docs/protocol_model.md introduces it.
 *
 * One robot, one station, two operators, and the link between them, which breaks; robot and station restart. Each rule
 * below is a sentence of docs/protocol.md (its section in brackets); `check.py rules` removes one at a time. What must
 * hold is in `assert`.
 *
 * Time is counted in eras: a lease, and a command's time to live, end with the era in which they began; the link is
 * held for lost after a whole era of silence. Numbers are not random: stops, emergencies and times of control count up.
 */

/* Bounds, a rule to remove, and a trace come from the environment, so that one compilation serves all searches. */
c_decl {
  static struct { int stops, faults, boots, connections, restarts, tenures, eras, commands, repeats, operators; } bound;
  static int removed, removed_too;          /* numbers of rules; 0: none */
  static int trace[2][400], length[2];      /* actions of the robot, and of the station: 256 kind + argument */
  static int number(const char *name) {
    const char *text = getenv(name);
    return text ? atoi(text) : 0;
  }
  static void read_actions(int whose, const char *name) {
    const char *text = getenv(name);
    for (; text && *text && length[whose] < 400; text += *text == ' ') {
      trace[whose][length[whose]++] = (int)strtol(text, (char **)&text, 10);
    }
  }
  static void read_environment(void) {
    bound.stops = number("STOPS"); bound.faults = number("FAULTS"); bound.boots = number("BOOTS");
    bound.connections = number("CONNECTIONS"); bound.restarts = number("RESTARTS");
    bound.tenures = number("TENURES"); bound.eras = number("ERAS"); bound.commands = number("COMMANDS");
    bound.repeats = number("REPEATS"); bound.operators = number("OPERATORS"); removed = number("WITHOUT");
    removed_too = number("WITHOUT_TOO");
    read_actions(0, "ROBOT_TRACE"); read_actions(1, "STATION_TRACE");
  }
}
#define has_rule(which) c_expr { removed != which && removed_too != which }

/* Rules of the robot. */
#define OTHER_BOOT         has_rule(1) /* [Commands] other_boot: "it is for another boot of this robot" */
#define EXPIRED            has_rule(2) /* [Commands] valid_until_robot_us: "later than this it is refused as expired" */
#define TIMED_EXPIRED      has_rule(3) /* [Commands] expired: "or it waited for its time, and was dropped" */
#define REFUSED_LATCHED    has_rule(4) /* [Commands] latched: "in emergency" */
#define LATCH_HOLDS_DUTY   has_rule(5) /* [Emergency stop] "output 0, latch, acknowledgement" */
#define STOP_ENDS_ORDERS   has_rule(6) /* [States] "No setpoint, duty, lease or schedule outlives ... an emergency" */
#define STOP_DROPS_TIMED   has_rule(7) /* [The lease] "An emergency and a change of mode reject them." */
#define NEW_EMERGENCY_ID   has_rule(8) /* [Emergency stop] "Each stop gives the latch a new emergency_id" */
#define CLEAR_NAMES_LATCH  has_rule(9) /* [Emergency stop] "clear_emergency resets the emergency that it names" */
#define LATCHES_ANEW       has_rule(10) /* [Emergency stop] "while latched the robot answers duplicate ..., otherwise it latches anew" */
#define DUTY_LAPSES        has_rule(11) /* [The lease] "When the lease lapses, the duty is 0" */
#define TIMED_LAPSE        has_rule(12) /* [The lease] "When this lease lapses, ... all timed commands are dropped" */
#define LINK_LOSS_STOPS    has_rule(13) /* [Link loss] "stop (default): manual, duty 0, no setpoint" */
#define LINK_LOSS_DROPS    has_rule(14) /* [The lease] "They are also dropped ... by the loss of the link." */
#define BOOTS_AT_REST      has_rule(15) /* [States] "After boot ... the robot is in manual with duty 0 and without setpoint." */

/* Rules of the station. */
#define STOP_KEPT          has_rule(16) /* [Emergency stop] "A stop that cannot be delivered is stored by the station" */
#define STOP_RESTORED      has_rule(17) /* [Emergency stop] "also over a restart of the station" */
#define STOP_FIRST         has_rule(18) /* [Emergency stop] "It is the first frame after each Welcome" */
#define STOP_OVERTAKES     has_rule(19) /* [Emergency stop] "ahead of everything that waits on both sides" */
#define STOP_SUPERSEDES    has_rule(20) /* [Emergency stop] "It supersedes all that is queued for the robot." */
#define CLEAR_WAITS        has_rule(21) /* [Emergency stop] "Until then the station refuses clear_emergency." */
#define STATION_LATCHES    has_rule(22) /* [Emergency stop] "The station latches too" */
#define STOPPED_AGAIN      has_rule(23) /* [Emergency stop] "A robot that returns from a reset without its latch is stopped again." */
#define LATCH_RESTORED     has_rule(24) /* [Emergency stop] the station's latch, too, outlives its restart */
#define NEWER_COUNTS       has_rule(25) /* [Who sends what] acknowledgements of stops pass telemetry: of two reports the newer counts */
#define ENDS_WITH_LINK     has_rule(26) /* [Commands] "the station sends no command twice": what waits for the link ends with it */
#define ONE_IN_CONTROL     has_rule(27) /* [Who sends what] Command: "when a caller with the right requests it" */
#define WITHDRAWS          has_rule(28) /* [The lease] "the station withdraws what it has not sent yet" */
#define DROPS              has_rule(29) /* [The lease] "and sends drop_timed" */
#define DROP_COMES_FIRST   has_rule(30) /* [The lease] "No other command is sent to this robot before that" */
#define DROP_AFTER_LINK    has_rule(31) /* [The lease] "drop_timed is the first command of the next connection of the same boot" */
#define DROP_AFTER_RESTART has_rule(32) /* [The lease] "after a restart of the station ... they may exist" */

/* Bounds. */
#define STOPS       c_expr { bound.stops } /* asked for by people */
#define FAULTS      c_expr { bound.faults } /* emergencies of the robot's own */
#define BOOTS       c_expr { bound.boots }
#define CONNECTIONS c_expr { bound.connections }
#define RESTARTS    c_expr { bound.restarts } /* of the station */
#define TENURES     c_expr { bound.tenures } /* times of control */
#define ERAS        c_expr { bound.eras }
#define COMMANDS    c_expr { bound.commands } /* other than stops and drops */
#define REPEATS     c_expr { bound.repeats } /* of stops */
#define OPERATORS   c_expr { bound.operators }
#ifndef ROOM
#define ROOM 3              /* frames in each direction of a connection */
#endif

#define EVERY_TENURE 255    /* of timed commands of which a restarted station knows nothing */

mtype = { welcome, stop, clear, duty, automatic, timed, renew, drop, rest };   /* to the robot; rest: only replayed */
mtype = { hello, stop_ack, clear_ack, drop_ack, sample };                /* to the station */
mtype = { at_rest, manual, in_auto };

/* The frames of the connection, in order. A command has: the stop, emergency or drop that it names, the boot it is for,
 * the era in which it expires, and for the assertions: whose time of control it is of, over which connection it was
 * sent, the stops asked for and promised until then; of a clear instead the moment of the latch that its sender has seen. */
chan to_robot = [ROOM] of { mtype, byte, byte, byte, byte, byte, byte, byte };
chan to_station = [ROOM] of { mtype, byte, byte, byte, byte };  /* kind, what it names or boot, connection, latch, moment */
chan queue = [1] of { mtype, byte, byte, byte, byte, byte, byte, byte };  /* in the station, behind the stop's lane */

byte era = 1;

/* The robot. */
byte boot = 1, connection, latch, last_id, heard = 1;
bool is_welcome;
byte moment;                         /* counts each change of the latch, in the robot's time */
byte latched_at;                     /* the moment of the latch in force */
mtype motion = at_rest;
byte lease;                          /* the era with which the duty ends; a renewal adds the next one */
byte timed_of, timed_until, timed_lease, timed_stops, timed_promises;   /* one command that waits; timed_of 0: none */
int remembered;                      /* stops that this boot has obeyed, as bits */
bool has_sample; byte sample_latch, sample_moment, sampled = 255;
byte held_stop, held_latch, held_moment;                /* an acknowledgement that could not be sent; 0: none */

/* The station. */
byte served, served_boot;            /* connection (0: none), and the boot that it was of */
byte pending, lane;                  /* the newest stop without an answer; what is written before all else */
byte known_latch, known_moment;
byte holder, tenure;                 /* who is in control (0: nobody), and the how manieth time of control it is */
byte may_wait;                       /* of which tenure timed commands may wait on the robot */
bool drop_due;
byte drops, drop_sent;               /* how many were sent; the one that has no answer yet, 0: none */
byte stored_pending, stored_latch, stored_moment;   /* on disk */
byte seen_latch, seen_moment;        /* what the operators' pages show, maybe long ago */

/* What the assertions speak of, and the bounds. */
byte asked, answerable, promised;    /* stops: asked for; to be answered once stored; answered */
byte obeyed;                         /* newest stop that the robot has obeyed */
byte reign;                          /* newest time of control of which the robot has run a command */
bool must_stand;                     /* obeyed a stop, and nobody has cleared it */
byte forgotten_to;                   /* the station was killed before it had stored these stops, or their latch */
byte faults, dials, restarts, commands, repeats;

#define moves (motion != at_rest && (!LATCH_HOLDS_DUTY || latch == 0))

/* With a trace of a real system only its actions happen, in the robot's order and in the station's; Spin finds how they
 * interleave. An action that the trace has not next leads nowhere. */
short robot_step, station_step, expected;
bool left_trace;
#define replays c_expr { length[0] + length[1] > 0 }
#define LAPSE 20          /* an action is a frame that is sent or obeyed, or one of these */
#define SILENCE 21
#define EMERGENCY 22
#define CONTROL 23
#define RESTART 24
#define CONNECTED 25
#define BOOT 26
#define MOVING 27
#define AT_REST 28        /* what moved has ended without a command, a lapse, a stop or a lost link */
#define robot_next(what) c_expr { now.robot_step < length[0] && trace[0][now.robot_step] / 256 == what }
#define STOP 8            /* as C knows these frames */
#define CLEAR 7
#define station_next(what) c_expr { now.station_step < length[1] && trace[1][now.station_step] / 256 == what }
#define all_done c_expr { now.robot_step == length[0] && now.station_step == length[1] }
/* Steps that a trace does not show are left out of a replay where nothing later in it can need them. That makes the search
 * short; it can only refuse an execution, never allow one. */
#define MAY_SAMPLE (!replays || FAULTS > 0)           /* else acknowledgements and hellos report each change of the latch */
#define MAY_SEE (!replays || station_next(CLEAR))
#define MAY_STORE (!replays || restarts < RESTARTS)
#define MAY_STOP (!replays || (station_next(STOP) && lane == 0))   /* the station writes a stop at once */
#define MAY_PASS (!replays || robot_next(LAPSE) || robot_next(SILENCE))

inline robot_does(what, argument) {
  if
  :: !replays
  :: replays ->
    c_code { now.expected = now.robot_step < length[0] ? trace[0][now.robot_step] : -1; };
    left_trace = (expected != 256 * what + argument);
    expected = 0;
    robot_step++
  fi
}

inline station_does(what, argument) {
  if
  :: !replays
  :: replays ->
    c_code { now.expected = now.station_step < length[1] ? trace[1][now.station_step] : -1; };
    left_trace = (expected != 256 * what + argument);
    expected = 0;
    station_step++
  fi
}

inline lose_commands(channel) {
  do
  :: nempty(channel) -> channel?_, _, _, _, _, _, _, _
  :: empty(channel) -> break
  od
}

inline lose_reports() {
  do
  :: nempty(to_station) -> to_station?_, _, _, _, _
  :: empty(to_station) -> break
  od
}

/* What the station writes into a connection that the robot has left is lost. */
inline write(kind, name, until, whose, over, stops, promises) {
  if
  :: connection == served && connection != 0 -> to_robot!kind, name, served_boot, until, whose, over, stops, promises
  :: else
  fi
}

/* The same the other way. */
inline report(kind, name) {
  if
  :: connection == served -> to_station!kind, name, connection, latch, moment
  :: else
  fi
}

/* ---------------------------------------------------------------- The robot */

inline come_to_rest() {
  motion = at_rest; lease = 0
}

inline drop_timed() {
  timed_of = 0; timed_until = 0; timed_lease = 0; timed_stops = 0; timed_promises = 0
}

inline end_orders() {
  if
  :: STOP_ENDS_ORDERS -> come_to_rest()
  :: else
  fi;
  if
  :: STOP_DROPS_TIMED -> drop_timed()
  :: else
  fi
}

inline enter_emergency() {
  if
  :: NEW_EMERGENCY_ID -> last_id++
  :: else -> last_id = 1
  fi;
  latch = last_id;
  moment++;
  latched_at = moment;
  end_orders()
}

inline obey_stop(number) {
  if
  :: (remembered & (1 << number)) && (latch != 0 || !LATCHES_ANEW)
  :: else ->
    remembered = remembered | (1 << number);
    enter_emergency();
    obeyed = (number > obeyed -> number : obeyed);
    must_stand = true;
    robot_does(stop, 0)
  fi;
  if
  :: report(stop_ack, number)
  :: held_stop == 0 && connection == served -> held_stop = number; held_latch = latch; held_moment = moment
  fi
}

/* What holds whenever a command of the old or new kind sets the motor in motion. */
inline check_motion(until, whose, stops, promises) {
  assert(latch == 0);                /* nothing moves in emergency */
  assert(!must_stand);               /* after a stop nothing moves before it was cleared, not even after a reset */
  assert(until >= era);              /* nothing stale */
  assert(whose >= reign);            /* nothing of a former holder of control once the next one's command has come */
  assert(obeyed <= stops);           /* nothing that was asked for before a stop which has been obeyed */
  assert(promises <= obeyed)         /* no promised stop is still on its way */
}

#define runs_in_emergency(kind) (kind == clear || kind == drop)

inline run_command(kind, name, for_boot, until, whose, over, stops, promises) {
  assert(for_boot == boot);          /* nothing of an older boot */
  assert(over == connection);        /* nothing of an older connection */
  if
  :: kind == clear ->
    if
    :: latch != 0 && (!CLEAR_NAMES_LATCH || name == latch) ->
      assert(stops == latched_at);   /* a clear never lifts a stop that its sender has not seen */
      assert(whose >= reign);
      latch = 0;
      moment++;
      must_stand = false;
      assert(motion == at_rest && timed_of == 0);   /* nothing moves by itself after a clear */
      reign = whose;
      robot_does(clear, whose);
      report(clear_ack, 0)
    :: else
    fi
  :: kind == drop -> drop_timed(); report(drop_ack, name)
  :: kind == timed ->
    if
    :: timed_of == 0 || timed_of == whose ->
      timed_of = whose; timed_until = until; timed_lease = era; timed_stops = stops; timed_promises = promises
    :: else                          /* no room */
    fi;
    reign = (whose > reign -> whose : reign)
  :: kind == renew ->
    if
    :: motion == manual || timed_of != 0 ->
      assert(motion == manual || timed_of >= whose);   /* nobody renews what a former holder has left waiting */
      lease = (motion == manual -> era + 1 : 0); timed_lease = (timed_of != 0 -> era + 1 : 0);
      reign = (whose > reign -> whose : reign);
      skip
    :: else
    fi
  :: kind == duty || kind == automatic ->
    check_motion(until, whose, stops, promises);
    reign = whose;
    if
    :: kind == duty && motion != in_auto -> motion = manual; lease = era; robot_does(duty, whose)
    :: kind == duty && motion == in_auto           /* wrong_mode */
    :: kind == automatic -> motion = in_auto; lease = 0; drop_timed(); robot_does(automatic, whose)
    fi
  :: kind == rest ->
    come_to_rest();
    drop_timed();
    reign = (whose > reign -> whose : reign);
    robot_does(rest, whose)
  fi
}

proctype Robot() provided (!left_trace) {
  mtype kind;
  byte name, for_boot, until, whose, over, stops, promises;
end:
  do
  :: atomic { connection == 0 && dials < CONNECTIONS && len(to_station) <= ROOM - 2 ->
      dials++;
      connection = dials;
      is_welcome = false;
      has_sample = false;            /* is sent as backfill, which says nothing of the present */
      if
      :: nempty(to_station) -> lose_reports()   /* what the robot wrote last may have been lost */
      :: skip
      fi;
      to_station!hello, boot, connection, latch, moment;
      if
      :: held_stop != 0 -> to_station!stop_ack, held_stop, connection, held_latch, held_moment; held_stop = 0
      :: else
      fi
    }
  :: atomic { connection != 0 && nempty(to_robot) && nfull(to_station) ->
      to_robot?kind, name, for_boot, until, whose, over, stops, promises;
      heard = era;
      if
      :: kind == welcome -> is_welcome = true
      :: kind == stop -> obey_stop(name)
      :: else ->
        if
        :: OTHER_BOOT && for_boot != boot
        :: else ->
          if
          :: EXPIRED && until < era
          :: else ->
            if
            :: REFUSED_LATCHED && latch != 0 && !runs_in_emergency(kind)
            :: else -> run_command(kind, name, for_boot, until, whose, over, stops, promises)
            fi
          fi
        fi
      fi;
      kind = 0; name = 0; for_boot = 0; until = 0; whose = 0; over = 0; stops = 0; promises = 0
    }
  :: atomic { timed_of != 0 && latch == 0 && motion != in_auto ->   /* the time of a timed command */
      if
      :: TIMED_EXPIRED && timed_until < era
      :: else ->
        check_motion(timed_until, timed_of, timed_stops, timed_promises);
        motion = manual; lease = era
      fi;
      drop_timed()
    }
  :: atomic { faults < FAULTS && latch == 0 -> faults++; enter_emergency(); robot_does(EMERGENCY, 0) }
  :: atomic { MAY_SAMPLE && !has_sample && sampled != moment && connection != 0 ->
      has_sample = true; sample_latch = latch; sample_moment = moment; sampled = moment }
  :: atomic { has_sample && connection != 0 && nfull(to_station) ->
      if
      :: connection == served -> to_station!sample, 0, connection, sample_latch, sample_moment
      :: else
      fi;
      has_sample = false; sample_latch = 0; sample_moment = 0 }
  :: atomic { connection != 0 -> connection = 0; is_welcome = false; lose_commands(to_robot) }  /* it breaks */
  od
}

/* What happens to the robot from outside: time and resets. */
proctype World() provided (!left_trace) {
end:
  do
  :: atomic { era < ERAS && MAY_PASS ->
      era++;
      if
      :: DUTY_LAPSES && motion == manual && lease < era ->
        come_to_rest();
        robot_does(LAPSE, 0);
        drop_timed()
      :: else
      fi;
      if
      :: TIMED_LAPSE && timed_of != 0 && timed_lease < era -> drop_timed()
      :: else
      fi;
      if
      :: heard + 1 < era ->
        robot_does(SILENCE, 0);
        if
        :: LINK_LOSS_STOPS -> come_to_rest()
        :: else
        fi;
        if
        :: LINK_LOSS_DROPS -> drop_timed()
        :: else
        fi
      :: else
      fi;
      assert(motion != manual || lease >= era);                   /* no duty without its lease */
      assert(timed_of == 0 || timed_lease >= era);
      assert(!moves || heard + 1 >= era)                          /* no motion without the link */
    }
  :: atomic { boot < BOOTS ->
      boot++;
      connection = 0; is_welcome = false; lose_commands(to_robot);
      remembered = 0; held_stop = 0; has_sample = false; drop_timed();
      if
      :: BOOTS_AT_REST -> come_to_rest()
      :: else
      fi;
      if
      :: latch != 0                                               /* survives where the robot's memory does */
      :: latch != 0 && NEW_EMERGENCY_ID -> latch = 0; moment++; must_stand = must_stand && obeyed > forgotten_to
      :: latch == 0
      fi;
      robot_does(BOOT, 0);
      assert(!moves)                                              /* nothing moves by itself */
    }
  od
}

/* -------------------------------------------------------------- The station */

inline withdraw_queued() {
  lose_commands(queue)
}

#define only_ends_motion (queue?[drop, _, _, _, _, _, _, _] || queue?[rest, _, _, _, _, _, _, _])

/* Control has ended or changed hands. */
inline control_ended() {
  if
  :: WITHDRAWS && only_ends_motion
  :: WITHDRAWS && !only_ends_motion -> withdraw_queued()
  :: !WITHDRAWS
  fi;
  if
  :: DROPS && may_wait != 0 -> drop_due = true
  :: else
  fi
}

inline end_of_connection() {
  served = 0;
  lane = 0;
  if
  :: ENDS_WITH_LINK -> withdraw_queued()
  :: else
  fi
}

inline on_hello(new_boot, new_connection, its_latch, its_moment) {
  bool lost_its_latch;
  lost_its_latch = STOPPED_AGAIN && known_latch != 0 && new_boot != served_boot && its_latch == 0;
  end_of_connection();
  served = new_connection;
  if
  :: new_boot != served_boot -> may_wait = 0; drop_sent = 0      /* a reset loses them */
  :: else
  fi;
  served_boot = new_boot;
  known_latch = its_latch;
  known_moment = its_moment;
  drop_due = DROP_AFTER_LINK && (may_wait != 0 || drop_sent != 0);
  write(welcome, 0, 0, 0, served, 0, 0);
  station_does(CONNECTED, 0);
  if
  :: pending != 0 && STOP_FIRST -> lane = pending
  :: pending == 0 && lost_its_latch -> asked++; pending = asked; lane = pending
  :: else
  fi;
  lost_its_latch = false
}

inline learn(its_latch, its_moment, is_new) {
  if
  :: !NEWER_COUNTS || is_new -> known_latch = its_latch; known_moment = its_moment
  :: else
  fi
}

proctype Station() provided (!left_trace) {
  mtype kind;
  byte name, over, its_latch, its_moment, for_boot, until, whose, stops, promises;
end:
  do
  :: atomic { nempty(to_station) && nfull(to_robot) ->
      to_station?kind, name, over, its_latch, its_moment;
      if
      :: kind == hello -> on_hello(name, over, its_latch, its_moment)
      :: kind != hello && over != served                          /* of a connection that was replaced */
      :: kind == stop_ack && over == served ->
        learn(its_latch, its_moment, its_moment >= known_moment);
        pending = (name >= pending -> 0 : pending)                /* it settles those before it */
      :: kind == clear_ack && over == served -> learn(its_latch, its_moment, its_moment > known_moment)
      :: kind == drop_ack && over == served -> drop_sent = (name == drop_sent -> 0 : drop_sent)
      :: kind == sample && over == served -> learn(its_latch, its_moment, its_moment >= known_moment)
      fi;
      kind = 0; name = 0; over = 0; its_latch = 0; its_moment = 0
    }
  :: atomic { served != 0 && lane != 0 && nfull(to_robot) && (STOP_OVERTAKES || empty(queue)) ->
      write(stop, lane, 0, 0, served, 0, 0); lane = 0 }
  :: atomic { served != 0 && nempty(queue) && nfull(to_robot) && (lane == 0 || !STOP_OVERTAKES) ->
      queue?kind, name, for_boot, until, whose, over, stops, promises;
      assert(lane == 0);                                          /* a stop goes ahead of everything */
      assert(kind == drop || kind == rest || holder != 0 && whose == tenure);  /* nothing of a former holder of control */
      assert(kind == drop || kind == clear || stops == asked);    /* nothing asked for before a stop is sent after it */
      write(kind, name, until, whose, over, stops, promises);
      kind = 0; name = 0; for_boot = 0; until = 0; whose = 0; over = 0; stops = 0; promises = 0
    }
  :: atomic { served != 0 && drop_due && empty(queue) ->
      drop_due = false; drops++; drop_sent = drops; may_wait = 0;
      queue!drop, drops, served_boot, era + 1, tenure, served, asked, promised }
  :: atomic { served != 0 && pending != 0 && lane == 0 && repeats < REPEATS -> repeats++; lane = pending }
  :: atomic { served != 0 -> station_does(SILENCE, 0); end_of_connection() }
  :: atomic { holder != 0 -> holder = 0; station_does(CONTROL, 0); control_ended() }   /* released or expired */
  :: atomic { MAY_STORE && (stored_pending != pending || stored_latch != known_latch || answerable != 0) ->
      stored_pending = pending; stored_latch = known_latch; stored_moment = known_moment;
      promised = (answerable > promised -> answerable : promised); answerable = 0 }
  :: atomic { restarts < RESTARTS ->
      restarts++;
      end_of_connection();
      withdraw_queued();
      lose_reports();
      forgotten_to = (stored_pending == 0 && stored_latch == 0 -> asked : forgotten_to);
      must_stand = must_stand && (latch != 0 || obeyed > forgotten_to);
      pending = (STOP_RESTORED -> stored_pending : 0);
      known_latch = (LATCH_RESTORED -> stored_latch : 0);
      known_moment = stored_moment; holder = 0; answerable = 0; drop_due = false; drop_sent = 0;
      may_wait = (DROP_AFTER_RESTART -> EVERY_TENURE : 0);
      station_does(RESTART, 0)
    }
  od
}

/* ------------------------------------------------------------ The operators */

#define is_latched (STATION_LATCHES && (known_latch != 0 || pending != 0))
#define is_free (served != 0 && empty(queue) && commands < COMMANDS && (!drop_due || !DROP_COMES_FIRST))
#define may_command(me) (holder == me || (holder == 0 && tenure < TENURES) || (!ONE_IN_CONTROL && tenure > 0))

/* A command to a robot that nobody controls takes control. */
inline take_control(me) {
  if
  :: holder == 0 -> tenure++; holder = me; my_tenure = tenure; station_does(CONTROL, me)
  :: else
  fi
}

inline command(me, kind, name, until, stops) {
  take_control(me);
  commands++;
  station_does(kind, me);
  queue!kind, name, served_boot, until, my_tenure, served, stops, promised
}

proctype Operator(byte me) provided (!left_trace) {
  byte my_tenure;
end:
  do
  :: atomic { MAY_STOP && asked < STOPS && (served != 0 || pending == 0) ->   /* another stop of a robot that is away is the same */
      asked++;
      answerable = asked;
      station_does(stop, me);
      if
      :: served != 0 ->
        pending = asked;
        lane = asked;
        if
        :: STOP_SUPERSEDES -> withdraw_queued()
        :: else
        fi
      :: served == 0 && STOP_KEPT -> pending = asked
      :: served == 0 && !STOP_KEPT
      fi
    }
  :: atomic { MAY_SEE && (seen_moment != known_moment || seen_latch != known_latch) ->
      seen_latch = known_latch; seen_moment = known_moment }
  :: atomic { is_free && may_command(me) && seen_latch != 0 && (pending == 0 || !CLEAR_WAITS) ->
      command(me, clear, seen_latch, era, seen_moment) }
  :: atomic { is_free && may_command(me) && !is_latched -> command(me, duty, 0, era, asked) }
  :: atomic { is_free && may_command(me) && !is_latched -> command(me, automatic, 0, era, asked) }
  :: atomic { is_free && may_command(me) && !is_latched -> command(me, renew, 0, era, asked) }
  :: atomic { is_free && may_command(me) && !is_latched ->
      command(me, timed, 0, era + 1, asked);
      may_wait = my_tenure }
  :: atomic { replays && is_free && may_command(me) -> command(me, rest, 0, era, asked) }
  :: atomic { (replays || holder != 0 && holder != me) && tenure < TENURES ->   /* by force, or handed over; or is free */
      tenure++; holder = me; my_tenure = tenure;
      station_does(CONTROL, me);
      control_ended() }
  od
}

/* What samples show, and the end of a trace, which Spin reports as an error. */
proctype Witness() provided (!left_trace) {
end:
  do
  :: atomic { replays && robot_next(MOVING) && moves -> robot_step++ }
  :: atomic { replays && robot_next(AT_REST) -> come_to_rest(); drop_timed(); robot_does(AT_REST, 0) }
  :: atomic { replays && all_done -> assert(false) }
  od
}

init {
  atomic {
    assert(stop == STOP && clear == CLEAR);
    c_code { read_environment(); };
    run Robot(); run World(); run Station(); run Operator(1); run Operator(2); run Witness();
    if
    :: OPERATORS > 2 -> run Operator(3); run Operator(4)          /* of a trace */
    :: else
    fi
  }
}
