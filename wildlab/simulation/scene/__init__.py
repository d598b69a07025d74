"""Scenes: what a thermal camera would see of sea and land and of what is on them, with exact labels.

A scene is rendered from a pose, with the projection of `wildlab.geometry`; what is found in it is then
judged against labels that are known and not marked by anybody. `render` makes kelvin and labels of the
sea and of vessels, `land` of covers under the sun of a day, `drawn` has what stands on land; `flights` takes
images along a twin's flight, with the faults of a camera. `coloured` is even ground and a tarpaulin as a
colour camera sees them. All of it is chosen; nothing in it knows of a detector.

A body's temperatures are even parts, textures and hot places; there is no heat flow, no spray, no reflection
of the body in the water, and no weather between.
"""
