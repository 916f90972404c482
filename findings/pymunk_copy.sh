# pymunk 7.3.1: a copy, or a pickle, of a space in which bodies touch goes on otherwise than the space itself, although it
# holds the contacts. Without touch, or with `collision_persistence = 0`, both go on alike.
set -- pymunk==7.3.1
. "$(dirname "$0")/run.sh" <<'PYTHON'
import pickle, random
import pymunk


def scene(boxes, gravity, persistence=3):
    space, rng = pymunk.Space(), random.Random(1)
    space.gravity, space.collision_persistence = gravity, persistence
    space.add(pymunk.Segment(space.static_body, (-500, 0), (500, 0), 5))
    for number in range(boxes):
        body = pymunk.Body(1, pymunk.moment_for_box(1, (30, 30)))
        body.position = rng.uniform(-20, 20), 40 + number * 35
        box = pymunk.Poly.create_box(body, (30, 30))
        box.friction = 0.6
        space.add(body, box)
    run(space)
    return space


def run(space):
    for _ in range(60):
        space.step(1 / 60)
    return [number for body in space.bodies for number in (*body.position, body.angle)]


def apart(space, other):
    return max(abs(ours - theirs) for ours, theirs in zip(run(space), run(other)))


print("pymunk", pymunk.version)
found = {}
for name, settings in {
    "no touch": (12, (0, 0)),
    "one box on the floor": (1, (0, -900)),
    "twelve boxes in a heap": (12, (0, -900)),
    "the heap, persistence 0": (12, (0, -900), 0),
}.items():
    copied = apart(space := scene(*settings), space.copy())
    pickled = apart(space := scene(*settings), pickle.loads(pickle.dumps(space)))
    found[name] = copied, pickled
    print(f"{name}: 60 steps later a copy is {copied:.2g} away, a pickle {pickled:.2g}; built again {apart(scene(*settings), scene(*settings))}")
assert found["no touch"] == found["the heap, persistence 0"] == (0, 0)
assert min(found["one box on the floor"]) > 1e-9
assert min(found["twelve boxes in a heap"]) > 1
PYTHON
