"""A scene file that uses most of what there is, for tests that spoil it."""

GOOD = """\
schema_version: 1
name: harbour
up_axis: Z
gravity: [0, 0, -9.81]
dt: 1e-3
duration: 2
integrator: velocity_verlet
bodies:
  - type: rope
    name: mooring
    start: [0, 0, 1]
    end: [4, 0, 1]
    segments: 40
    stretch_stiffness: 1e5
    color: [0.8, 0.6, 0.1]
  - type: net
    name: trawl
    size: [2, 1]
    cells: [20, 10]
    position: [0, 3, 2]
    damping: 0.1
  - type: solid
    name: buoy
    box:
      size: [0.5, 0.5, 0.5]
      cells: [2, 2, 2]
    density: 300
  - type: solid
    name: hull
    mesh: hull.obj
forces:
  - name: wind
    body: trawl
    expression: ["5 * sin(2 * pi * t)", 0, "-0.1 * vz"]
constraints:
  - type: nail
    name: bollard
    points:
      body: mooring
      index: 0
    goal:
      times: [0, 1, 2]
      offsets: [[0, 0, 0], [0, 0, 0.5], [0, 0, 0]]
      interpolation: smooth
    start: 0
    end: 1.5
    ramp:
      steps: 20
      max_speed: 2.0
  - type: attach
    name: ring
    points: {body: mooring, index: 40}
    to: {body: buoy, nearest: tetrahedron}
    break_force: 1e4
  - type: points_to_point
    name: knots
    groups:
      - [{body: mooring, index: 10}, {body: trawl, index: 0}]
      - [{body: mooring, index: 20}, {body: trawl, index: 5}]
  - type: slide
    name: shackle
    points: {body: trawl, index: 30}
    on: {body: buoy, surface: true, where: "z > 0.2"}
  - type: velocity
    name: winch
    points: {body: trawl, side: +x, thickness: 0.05}
    goal: [0, 0, 0.1]
"""
