# Everything that is done in this repository is one of these commands; `make` alone lists them.
.DEFAULT_GOAL := help
.PHONY: help demo view fit faults soak bench bench-check security docs test build setup lint clean

help:
	@printf '%s\n' \
	  'make demo      swing the arm three ways through real ROS 2 nodes; results in out/demo' \
	  'make view      swing the arm in a window of MuJoCo; needs a screen' \
	  'make test      all tests; make test ARGS="-k ramp" for some of them' \
	  'make lint      ruff, ruff format and mypy' \
	  'make fit       fit arm and emulated winches to the paper again; results in out/fit' \
	  'make faults    break everything, many times; writes docs/fault_matrix.md' \
	  'make soak      swing for 30 minutes at 1 kHz; memory and rates in out/soak' \
	  'make bench     measure everything beside a baseline; results in out/bench, docs/performance.md' \
	  'make bench-check  is a ratio worse than the last accepted one?' \
	  'make security  make keys for authenticated and encrypted ROS; results in keystore' \
	  'make docs      docs/parameters.md again, and the API reference in out/docs' \
	  'make build     set up and build the workspace; the commands above do it by themselves' \
	  'make clean     remove everything that these commands made, but no keystore' \
	  '' \
	  'In a shell of your own: source scripts/ros_env.bash'

demo: build
	@scripts/ros_env python demo/run_demo.py $(ARGS)

view: build
	@scripts/ros_env ros2_ws/install/musashi_muscle_bridge/lib/musashi_muscle_bridge/view_swing $(ARGS)

fit: build
	@scripts/ros_env python fit/kinematic_fit.py $(ARGS)
	@scripts/ros_env python fit/plant_fit.py $(ARGS)

faults: build
	@scripts/ros_env python test/faults/run_matrix.py $(ARGS)

soak: build
	@scripts/ros_env python test/soak/soak.py $(ARGS)

bench: build
	@scripts/ros_env python test/bench/run_bench.py $(ARGS)

bench-check: build
	@scripts/ros_env python test/bench/run_bench.py --check $(ARGS)

security: setup
	@.venv/bin/python security/make_keystore.py $(ARGS)

docs: build
	@scripts/ros_env python pages/parameter_page.py
	@scripts/ros_env python pages/api_reference.py

test: build
	@scripts/ros_env python -m pytest $(ARGS)

build:
	@python3 scripts/build_workspace.py

setup:
	@python3 scripts/setup_workspace.py

lint: setup
	@.venv/bin/ruff check
	@.venv/bin/ruff format --check
	@.venv/bin/mypy
	@.venv/bin/mypy ros2_ws/src/fastswing_inhibitor/test
	@.venv/bin/mypy ros2_ws/src/fastswing_planner/test
	@.venv/bin/mypy ros2_ws/src/musashi_muscle_bridge/test

clean:
	rm -rf .venv ros2_ws/build ros2_ws/install ros2_ws/log out setup.log .workspace.lock
	rm -rf .mypy_cache .pytest_cache .ruff_cache .hypothesis
