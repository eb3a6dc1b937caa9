-- Tables of a sweep, one file per sweep. A program that changes or removes columns also changes the version.
PRAGMA user_version = 1;

CREATE TABLE settings ( -- Settings of a sweep, from which its jobs are computed; the table has one row.
  mission TEXT, -- Mission file, or name of a shipped mission.
  mission_name TEXT, -- Name of the mission.
  cell TEXT, -- Path of the cell file.
  replacing_cell TEXT, -- Value of `--cell`, which replaces the cell of the mission, or "".
  overrides TEXT, -- Values of `--set` by param or by `cell.<key>.<key>`; equal in all runs.
  variations TEXT, -- Values of `--vary` by param or by `cell.<key>.<key>`; each combination is a variant.
  first_seed INTEGER, -- First seed of each variant.
  last_seed INTEGER, -- Last seed of each variant.
  scene TEXT, -- Scene file; NULL: no change of the simulated world.
  saves_images INTEGER, -- 1 if the runs save the images on which decisions are based.
  inputs_hash TEXT, -- Hash of mission, libraries, cell and scene; `--resume` requires equal inputs.
  versions TEXT, -- Versions of this project, Python, the machine and the required packages.
  PRIMARY KEY (mission)
);

CREATE TABLE runs ( -- A run. All columns except `wall_time_s`, `run_directory` and `crashes` are reproducible.
  run_index INTEGER, -- Index of the run in the sweep, from 0: variant by variant, and seed by seed.
  seed INTEGER, -- Random seed.
  variant TEXT, -- Values of the varied params and keys of the cell, by name.
  status TEXT, -- Final status: SUCCESS, INCOMPLETE, FAILURE or FAULT.
  reason TEXT, -- Reason of the failure, for instance `Transit.dropped`; `environment` if the disk, the memory or a killed process caused a FAULT; "" on success.
  message TEXT, -- Sentence that explains the status, or "".
  node TEXT, -- Path of the node that caused the status, or "".
  items_seen INTEGER, -- Number of items by final state, from the ledger.
  items_placed INTEGER,
  items_rejected INTEGER,
  items_skipped INTEGER,
  items_lost INTEGER,
  items_phantom INTEGER,
  audit_agrees INTEGER, -- Count of objects by ground-truth location, and whether the ledger agrees; NULL without ground truth.
  audit_right INTEGER,
  audit_wrong_bin INTEGER,
  audit_left INTEGER,
  audit_elsewhere INTEGER,
  audit_fell_in_wrong_bin INTEGER,
  audit_unseen INTEGER,
  planning_motions INTEGER, -- Number of planned motions, and time for which skills waited for plans [s].
  planning_ahead INTEGER,
  planning_waited_s REAL,
  ticks INTEGER, -- Number of control steps.
  robot_time_s REAL, -- Duration on the run clock (simulated time in simulation, real time on hardware) [s].
  wall_time_s REAL, -- Duration on a wall clock [s].
  decision_hash TEXT, -- Hash of all decisions.
  run_directory TEXT, -- Path of the run directory; "" if there is none.
  crashes INTEGER, -- Number of worker processes that died during the run; after the first, the run was repeated.
  PRIMARY KEY (run_index)
);

CREATE TABLE items ( -- An item of the ledger.
  run_index INTEGER, -- Index of the run.
  item TEXT, -- Name of the item.
  label TEXT, -- Class of the item.
  state TEXT, -- Final state: placed, rejected, skipped, lost, or phantom (false positive: no such object).
  bin TEXT, -- Bin into which the item was placed, or "".
  failed_attempts INTEGER, -- Number of failed attempts to pick the item.
  robot_time_s REAL, -- Time during which the item was the selected target and had no final state [s].
  PRIMARY KEY (run_index, item)
);

CREATE TABLE skills ( -- All activations of one skill in a run.
  run_index INTEGER, -- Index of the run.
  skill TEXT, -- Name of the skill.
  activations INTEGER, -- Number of activations.
  failed_activations INTEGER, -- Number of failed activations.
  robot_time_s REAL, -- Total duration of the activations [s]; the skills of parallel branches overlap.
  PRIMARY KEY (run_index, skill)
);
