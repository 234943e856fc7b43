//! Searches of many segments at once.
//!
//! A search through a large mesh is a chain of cache misses: which node is next is known only once
//! the last one has arrived. So several are under way and take steps in turn, and what each needs
//! next is fetched while the others take theirs (asynchronous memory access chaining: Kocberber,
//! Falsafi and Grot, VLDB 2015). What the caches hold is searched faster in one go, by one segment
//! after the other: the instances, and all meshes but large ones.

use super::accel::Top;
use super::mesh::{Corners, Underway};
use super::ray::LocalRay;
use super::tree_walk::Boxes;
use super::{AccelAt, InstanceId, Ray, Shape};
use arrayvec::ArrayVec;

/// Searches that are under way at a time: the memory of a core has as many requests open, or more.
const MOST: usize = 16;

/// Searches of meshes of one kind, each for a segment, by its index, in an instance.
struct Searches<'a, C: Corners + 'a> {
    underway: ArrayVec<(usize, InstanceId, Underway<'a, C>), MOST>,
    turn: usize,
}

/// Which segments are known to be stopped.
struct Answers<'s, S> {
    stopped: &'s mut [bool],
    stops: S,
}

impl AccelAt<'_> {
    /// [`AccelAt::occluded`] for each of the segments, in their order.
    ///
    /// # Panics
    /// If there are not as many answers as segments.
    pub fn occluded_each(
        &self,
        segments: &[Ray],
        opaque: impl Fn(InstanceId) -> bool,
        occluded: &mut [bool],
    ) {
        self.any_each(segments, opaque, |_, _| true, occluded);
    }

    /// [`AccelAt::any`] for each of the segments, in their order. `stops` is told which it is asked
    /// about by its index; segments take turns.
    ///
    /// # Panics
    /// If there are not as many answers as segments.
    pub fn any_each(
        &self,
        segments: &[Ray],
        visible: impl Fn(InstanceId) -> bool,
        mut stops: impl FnMut(usize, InstanceId) -> bool,
        stopped: &mut [bool],
    ) {
        assert_eq!(segments.len(), stopped.len(), "an answer for each segment");
        match self.accel().top() {
            Some(top) if self.accel().takes_turns => {
                self.in_turns(top, segments, visible, stops, stopped);
            }
            _ => {
                for (i, (ray, stopped)) in segments.iter().zip(stopped).enumerate() {
                    *stopped = self.any(ray, &visible, |id| stops(i, id));
                }
            }
        }
    }

    /// The same, where there are large meshes.
    fn in_turns(
        &self,
        top: &Top,
        segments: &[Ray],
        visible: impl Fn(InstanceId) -> bool,
        stops: impl FnMut(usize, InstanceId) -> bool,
        stopped: &mut [bool],
    ) {
        stopped.fill(false);
        let (mut still, mut moving) = (Searches::new(), Searches::new());
        let mut answers = Answers { stopped, stops };
        let (moment, time) = (self.moment(), self.moment().time());
        for (i, ray) in segments.iter().enumerate() {
            let Some(entry) = top.tree.enter(ray.o, ray.d, ray.t_max) else {
                continue;
            };
            let is_stopped = (&top.tree).any(
                &entry,
                |_| (),
                |leaf| {
                    let id = InstanceId(top.order[leaf.start as usize]);
                    if !visible(id) {
                        return false;
                    }
                    let instance = self.accel().instance(id);
                    if instance.shape.takes_turns()
                        && let Some(placement) = instance.transform.lasting(moment)
                    {
                        let to_object = &placement.to_object;
                        let local = |extent| LocalRay::new(ray, id, to_object, ray.t_max, extent);
                        match &instance.shape {
                            Shape::Mesh(mesh) => {
                                let search = mesh.start(local(mesh.extent()), time);
                                still.join((i, id), search, &mut answers);
                            }
                            Shape::Deforming(mesh) => {
                                let search = mesh.start(local(mesh.extent()), time);
                                moving.join((i, id), search, &mut answers);
                            }
                            _ => {}
                        }
                        // where another search of this segment has ended
                        return answers.stopped[i];
                    }
                    self.is_hit(ray, id) && (answers.stops)(i, id)
                },
            );
            answers.stopped[i] |= is_stopped;
        }
        still.finish(&mut answers);
        moving.finish(&mut answers);
    }
}

impl<'a, C: Corners> Searches<'a, C> {
    fn new() -> Self {
        Self {
            underway: ArrayVec::new(),
            turn: 0,
        }
    }

    /// Has a search (if there is one to do) take turns with the others, once there is room.
    #[inline]
    fn join(
        &mut self,
        (segment, id): (usize, InstanceId),
        search: Option<Underway<'a, C>>,
        answers: &mut Answers<impl FnMut(usize, InstanceId) -> bool>,
    ) {
        let Some(search) = search else {
            return;
        };
        if self.underway.is_full() {
            self.advance(answers);
        }
        self.underway.push((segment, id, search));
    }

    /// Has searches take steps in turn until one of them ends.
    #[inline(never)]
    fn advance(&mut self, answers: &mut Answers<impl FnMut(usize, InstanceId) -> bool>) {
        loop {
            if self.turn >= self.underway.len() {
                self.turn = 0;
            }
            let (segment, id, search) = &mut self.underway[self.turn];
            let (segment, id) = (*segment, *id);
            let ended = if answers.stopped[segment] {
                // by another instance
                Some(false)
            } else {
                search.step()
            };
            if let Some(is_hit) = ended {
                self.underway.swap_remove(self.turn);
                if is_hit && (answers.stops)(segment, id) {
                    answers.stopped[segment] = true;
                }
                return;
            }
            self.turn += 1;
        }
    }

    fn finish(&mut self, answers: &mut Answers<impl FnMut(usize, InstanceId) -> bool>) {
        while !self.underway.is_empty() {
            self.advance(answers);
        }
    }
}

#[cfg(test)]
mod tests;
