# Everything that is done in this repository is one of these commands; `make` alone lists them.
.DEFAULT_GOAL := help
.PHONY: help demo view fit faults soak bench bench-check security docs unit system test build setup lint clean

# What follows ## beside a target is what `make` says about it.
help: ## this list
	@sed -n 's/^\([a-z-]*\):[^#]*## /make \1\t/p' $(MAKEFILE_LIST) | expand -t 18
	@printf '\nIn a shell of your own: source scripts/ros_env.bash\n'

demo: build ## swing the arm three ways through real ROS 2 nodes; results in out/demo
	@scripts/ros_env python demo/run_demo.py $(ARGS)

view: build ## swing the arm in a window of MuJoCo; needs a screen
	@scripts/ros_env ros2_ws/install/musashi_muscle_bridge/lib/musashi_muscle_bridge/view_swing $(ARGS)

fit: build ## fit arm and emulated winches to the paper again; results in out/fit
	@scripts/ros_env python fit/kinematic_fit.py $(ARGS)
	@scripts/ros_env python fit/plant_fit.py $(ARGS)

faults: build ## break everything, many times, for an hour; writes docs/fault_matrix.md
	@scripts/ros_env python test/faults/run_matrix.py $(ARGS)

soak: build ## swing for 30 minutes at 1 kHz; memory and rates in out/soak: docs/soak.md
	@scripts/ros_env python test/soak/soak.py $(ARGS)

bench: build ## measure all beside baselines, 45 minutes; results in out/bench, docs/performance.md
	@scripts/ros_env python test/bench/run_bench.py $(ARGS)

bench-check: build ## is a ratio worse than the last accepted one?
	@scripts/ros_env python test/bench/run_bench.py --check $(ARGS)

security: setup ## make keys for authenticated and encrypted ROS, in keystore: SECURITY.md
	@.venv/bin/python security/make_keystore.py $(ARGS)

docs: build ## docs/parameters.md and the folders' picture again, and the API reference in out/docs
	@scripts/ros_env python pages/parameter_page.py
	@scripts/ros_env python pages/folder_picture.py
	@scripts/ros_env python pages/api_reference.py

unit: setup ## the tests without ROS, in seconds; make unit ARGS=planning for one folder
	@.venv/bin/python scripts/run_tests.py unit $(ARGS)

system: build ## all other tests, about 20 minutes; make system ARGS=nodes for one folder
	@scripts/ros_env python scripts/run_tests.py system $(ARGS)

test: build ## both, with more inputs for each law; make test ARGS="-k ramp" for some of them
	@scripts/ros_env python scripts/run_tests.py all $(ARGS)

build: ## set up and build the workspace; the others do it by themselves
	@python3 scripts/build_workspace.py

setup: ## make the Python environment alone
	@python3 scripts/setup_workspace.py

lint: setup ## ruff, ruff format and mypy
	@.venv/bin/ruff check
	@.venv/bin/ruff format --check
	@.venv/bin/mypy
	@.venv/bin/mypy ros2_ws/src/fastswing_inhibitor/test
	@.venv/bin/mypy ros2_ws/src/fastswing_planner/test
	@.venv/bin/mypy ros2_ws/src/musashi_muscle_bridge/test

clean: ## remove everything that these commands made, but no keystore
	rm -rf .venv ros2_ws/build ros2_ws/install ros2_ws/log out setup.log .workspace.lock
	rm -rf .mypy_cache .pytest_cache .ruff_cache .hypothesis
