//! Groups of connected parts that touch each other in a step: what is judged, shortened and limited together.
//!
//! Where tissue of one part presses on another's, the energy between them belongs to both, so that neither alone can say
//! whether a step has raised the potential. All numbers by which a step is judged are sums over the parts of a group, and
//! every part of it gets the same sum: the same decision follows. A part that touches no other is a group of its own, and
//! no bit of it depends on others.

use std::ops::Range;

/// Which parts are judged together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Groups {
    /// The lowest part of each part's group.
    lead: Vec<u32>,
    /// All parts, group by group, ascending in each.
    members: Vec<u32>,
    /// Of each part, the range of its group's members.
    ranges: Vec<[u32; 2]>,
}

impl Groups {
    /// So many parts, each alone.
    pub fn alone(parts: usize) -> Self {
        let mut groups =
            Self { lead: vec![0; parts], members: vec![0; parts], ranges: vec![[0; 2]; parts] };
        groups.part_all();
        groups
    }

    /// Every part is a group of its own.
    pub fn part_all(&mut self) {
        let all = self.lead.iter_mut().zip(&mut self.members).zip(&mut self.ranges);
        for (number, ((lead, member), range)) in (0..).zip(all) {
            (*lead, *member, *range) = (number, number, [number, number + 1]);
        }
    }

    /// Joins the groups of two parts; [`Groups::settle`] follows.
    pub fn join(&mut self, a: usize, b: usize) {
        let [a, b] = [a, b].map(|part| self.root(part));
        self.lead[a.max(b)] = a.min(b) as u32;
    }

    /// The lowest part that has been joined with one so far.
    fn root(&self, mut part: usize) -> usize {
        while self.lead[part] as usize != part {
            part = self.lead[part] as usize;
        }
        part
    }

    /// Puts the members of groups in order after all were joined.
    pub fn settle(&mut self) {
        for part in 0..self.lead.len() {
            self.lead[part] = self.root(part) as u32;
        }
        let Self { lead, members, ranges } = self;
        for (number, member) in (0..).zip(members.iter_mut()) {
            *member = number;
        }
        // No two keys are equal, so the order is one whatever the sort does.
        members.sort_unstable_by_key(|&part| (lead[part as usize], part));
        let mut start = 0;
        for group in members.chunk_by(|&a, &b| lead[a as usize] == lead[b as usize]) {
            let end = start + group.len() as u32;
            for &part in group {
                ranges[part as usize] = [start, end];
            }
            start = end;
        }
    }

    /// Whether a part is the lowest of its group, which acts for all.
    pub fn leads(&self, part: usize) -> bool {
        self.lead[part] as usize == part
    }

    /// Where the members of a part's group are, see [`Groups::member`].
    pub fn range(&self, part: usize) -> Range<usize> {
        let [start, end] = self.ranges[part];
        start as usize..end as usize
    }

    /// One member.
    pub fn member(&self, place: usize) -> usize {
        self.members[place] as usize
    }

    /// The parts of a part's group.
    pub fn of(&self, part: usize) -> impl Iterator<Item = usize> + '_ {
        self.members[self.range(part)].iter().map(|&part| part as usize)
    }

    /// Gives every part what the parts of its group have together.
    pub fn pool<T: Copy>(&self, of_parts: &mut [T], add: impl Fn(T, T) -> T) {
        for part in 0..self.lead.len() {
            if self.leads(part) && self.range(part).len() > 1 {
                let all = self.of(part).map(|part| of_parts[part]).reduce(&add);
                for part in self.of(part) {
                    of_parts[part] = all.unwrap_or(of_parts[part]);
                }
            }
        }
    }

    /// Tells a group from others, by its members; zero for a part alone.
    pub fn name(&self, part: usize) -> u64 {
        if self.range(part).len() < 2 {
            return 0;
        }
        let hash = |hash: u64, part: usize| (hash ^ part as u64).wrapping_mul(0x0100_0000_01b3);
        self.of(part).fold(0xcbf2_9ce4_8422_2325, hash)
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.lead[..]) + size_of_val(&self.members[..]) + size_of_val(&self.ranges[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_are_joined_have_what_all_of_them_have() {
        let mut groups = Groups::alone(6);
        let mut values = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
        groups.pool(&mut values, |a, b| a + b);
        assert_eq!(values, [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]);
        for (a, b) in [(5, 3), (1, 4), (3, 1)] {
            groups.join(a, b);
        }
        groups.settle();
        let lists: Vec<Vec<usize>> = (0..6).map(|part| groups.of(part).collect()).collect();
        assert_eq!(lists[5], [1, 3, 4, 5]);
        assert_eq!((&lists[1], &lists[3], &lists[4]), (&lists[5], &lists[5], &lists[5]));
        assert_eq!((&lists[0][..], &lists[2][..]), (&[0][..], &[2][..]));
        assert_eq!([0, 1, 2, 3].map(|part| groups.leads(part)), [true, true, true, false]);
        groups.pool(&mut values, |a, b| a + b);
        assert_eq!(values, [1.0, 58.0, 4.0, 58.0, 58.0, 58.0]);
        assert_eq!(groups.name(0), 0);
        assert!(groups.name(1) == groups.name(5) && groups.name(1) != 0);
        groups.part_all();
        assert_eq!(groups, Groups::alone(6));
    }
}
